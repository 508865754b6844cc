"""The random cases cover the language of case files, and what compares them notices a wrong number of any kind."""

import copy
from collections import Counter
from pathlib import Path

import h5py
import numpy as np
import pytest
from differential import transforms
from differential.__main__ import CASES, SEED
from differential.brute_force import followed, is_affordable, points_compared
from differential.comparison import DIFFERENT, apart, envelopes_apart, leaves
from differential.paths import document_of, keyed, paths_apart
from differential.random_cases import draw, stream
from differential.random_loads import STEPS
from differential.random_softening import SOFTENING
from differential.twin import SolvedAnew, _solved
from mpi4py import MPI
from scipy.sparse import csr_matrix
from support import dimensions
from support.dimensions import Units

from feti_homog import run

WRONG, LESS = 1e-6, 0.99
STATE, LAST = "state/0", STEPS - 1
COHESIVE = {"teeth", "softening_tolerance", "mixing_exponent", "friction_on_damage", "scatter"}
SHAPES = {"ellipses": "a", "polygons": "sides", "hollow fibres": "inner_radius", "coatings": "coating"}


def kinds(drawn):
    """List the parts of the language that a case has."""
    document, cell = drawn.document, drawn.document["cell"]
    rows, sections = cell.get("fibre_list", [{}]), transforms.sections(document)
    path = document.get("path", {})
    has = {cell["geometry"], drawn.analysis, f"plane {drawn.plane}", f"order {cell['order']}", cell["bodies"]}
    has |= {name for name, key in SHAPES.items() if key in cell or any(key in row for row in rows)}
    has |= {"voids"} if "voids" in cell or any(row.get("phase") == "void" for row in rows) else set()
    has |= {"own strengths"} & {"own strengths" * any("strength" in row for row in rows)}
    has |= {"refined"} & {"refined" * cell.get("refine", 0)}
    has |= {"pieces"} & {"pieces" * ("decomposition" in document)}
    for section in sections:
        law = str(section.get("law", section.get("criterion")))
        has |= {f"contact {section['contact']}", law, str(section.get("growth")), *(COHESIVE & section.keys())}
        has |= {"friction"} if section.get("friction") else set()
        has |= {"springs" if "normal_stiffness" in section else "glue", "arcs" * bool(section.get("debonded"))}
    has |= {"bonded"} if not sections else {f"{len(sections)} interfaces"}
    has |= {path.get("method", "events")} if path else set()
    loads = [load for load in transforms.waypoints(path) if isinstance(load, dict)] if path else []
    has |= {"legs"} if path and len(transforms.waypoints(path)) > 1 else set()
    has |= {"stresses"} if any(name[0] == "S" for load in loads for name in load) else set()
    return has | ({"temperature"} if any("temperature" in load for load in loads) else set())


def test_the_cases_of_ci_cover_the_language(tmp_path):
    found = Counter[str]()
    for number in range(CASES):
        (folder := tmp_path / str(number)).mkdir()
        drawn = draw(SEED, number, folder)
        assert drawn.case.name and draw(SEED, number, folder).document == drawn.document
        found.update(kinds(drawn))
    expected = {
        "square", "hexagonal", "random", "table", "mesh", "stiffness", "angle", "path", "load", "envelope",
        "plane strain", "plane stress", "plane generalized", "order 1", "order 2", "torus", "plane", *SHAPES, "voids",
        "refined", "pieces", "contact True", "contact False", "max", "quadratic", "energy", "released", "springs",
        "glue", "arcs", "bonded", "1 interfaces", "2 interfaces", "events", "increments", "legs", "stresses",
        "temperature", "friction", *SOFTENING, *COHESIVE, "own strengths",
    }  # fmt: skip
    assert expected <= found.keys(), expected - found.keys()


@pytest.fixture(scope="module")
def solved(tmp_path_factory):
    """Provide number -> case and folder of its result."""
    made = {}

    def of(wanted):
        """Return the first case that `wanted` takes."""
        for number in range(500):
            folder = tmp_path_factory.mktemp("case")
            drawn = draw(SEED, number, folder)
            if wanted(drawn):
                break
        if number not in made:
            run(drawn.case, MPI.COMM_SELF, out=folder / "out")
            made[number] = drawn, folder / "out"
        return made[number]

    return of


def is_small_path(drawn):
    return drawn.analysis == "path" and drawn.document["cell"]["geometry"] == "square" and drawn.plane == "generalized"


def is_load(drawn):
    return drawn.analysis == "load" and "interface" in drawn.document


def rubs(drawn):
    """Return True for increments with friction; their states are all kept."""
    return drawn.document.get("path", {}).get("method") == "increments" and "friction" in kinds(drawn)


def is_soft(drawn):
    """Return True for a leg along which many bonds soften, without friction."""
    return {"events", "teeth", "contact False"} <= kinds(drawn) and not {"friction", "legs"} & kinds(drawn)


def put(document, path, place=0):
    """Return a copy of a document in which the largest number of a kind is wrong."""
    wrong = copy.deepcopy(document)
    value, names = wrong, path.split(".")
    for name in names[:-1]:
        value = value[name.removesuffix("[]")]
        value = value[place] if name.endswith("[]") else value
    own = np.atleast_1d(np.asarray(value[names[-1]], float))
    own.flat[np.abs(own).argmax()] *= 1 + WRONG
    value[names[-1]] = own.tolist() if np.ndim(value[names[-1]]) else float(own[0])
    return wrong


@pytest.mark.slow
@pytest.mark.parametrize("wanted", [is_load, is_small_path])
def test_every_number_that_is_wrong_is_noticed(solved, wanted):
    _, folder = solved(wanted)
    document, noticed = document_of(folder), 0
    assert not max(off for off, _ in apart(document, document))
    names = {"cell"} if "path" in document else {"load", "cell", "phase_stresses"}
    for path, value in leaves({name: document[name] for name in sorted(names & document.keys())}):
        if np.asarray(value).dtype.kind == "f" and np.any(value) and "tips" not in path:
            assert max(off for off, _ in apart(document, put(document, path))) > 1e-4 * WRONG, path
            noticed += 1
    if "path" in document:
        for name in ("load_factor", "strain", "stress", "stored", "work"):
            place = max(range(len(document["path"])), key=lambda k: np.abs(document["path"][k][name]).max())
            (found, note) = paths_apart(document, put(document, f"path[].{name}", place), folder)
            assert not note and max(found)[0] > 0.1 * WRONG, name
            noticed += 1
        less = document | {"path": [p | {"broke": p["broke"] + 1} for p in document["path"]]}
        assert max(paths_apart(document, less, folder)[0])[0] == DIFFERENT
    assert noticed > 5


def test_estimates_of_ratios_that_nearly_vanish_are_measured_by_one():
    """Errors cancel in the estimate of nu31: bodies cut at the sides of a cell had 13 times as much."""
    names = ["nu12", "nu13", "nu31", "nu32"]
    less, more = ({"mesh_error": {"constants": dict.fromkeys(names, error)}} for error in (2e-5, 3e-4))
    assert len({*names}) == len(apart(less, more)) == 4
    assert [off for off, _ in apart(less, more)] == pytest.approx([2.8e-4] * len(names))


def test_faces_that_touch_are_counted_unless_friction_leaves_a_fibre_free():
    bound = {"free_motions": 0, "open": 3, "closed": 1, "friction_heat": 0.0}
    free = {"free_motions": 3, "open": 3, "closed": 0, "friction_heat": 0.0}

    def differs(point, **changes):
        base, other = ({"path_like": [bound, {**point, **own}]} for own in ({}, changes))
        return max(off for off, _ in apart(base, other)) == DIFFERENT

    assert not differs(free, open=2, closed=1)
    assert differs(bound, open=2, closed=2) and differs(free, free_motions=0)
    without = {name: value for name, value in free.items() if name != "friction_heat"}
    assert max(off for off, _ in apart({"load": without}, {"load": {**without, "open": 2}})) == DIFFERENT


def test_contact_that_changes_as_a_leg_begins_is_not_the_end_of_the_leg_before():
    """The step from there is 1e-9 of a leg, also of one that is cut in two."""
    steps = 0.0, 1e-10, 1e-9, 1.0
    ends = keyed([{"load_factor": (1.0 + step) / 2, "broke": 0, "open": k} for k, step in enumerate(steps)], 2, False)
    assert {key: point["open"] for key, point in ends.items()} == {("end", 1): 0, ("end", 2): 3}


def test_envelopes_that_differ_are_noticed():
    points = [{"factor": f, "strain": [f, 0.0], "stress": [2 * f, f]} for f in (1.0, 3.0)] + [{"factor": None}]
    for name in ("factor", "strain", "stress"):
        other = copy.deepcopy(points)
        other[1][name] = (np.asarray(other[1][name]) * (1 + WRONG)).tolist()
        assert max(envelopes_apart(points, other))[0] == pytest.approx(WRONG / 3, rel=1e-3)
    assert max(envelopes_apart(points, points))[0] == 0.0
    assert max(envelopes_apart(points, [*points[:2], points[0]]))[0] == DIFFERENT


@pytest.mark.parametrize("wanted", [is_load, is_small_path])
def test_results_go_to_other_units_and_back(solved, wanted):
    document = document_of(solved(wanted)[1])
    there = dimensions.in_units(document, Units(1e9, 1e-3))
    back = dimensions.in_units(there, Units(1e-9, 1e3))
    assert max(off for off, _ in apart(document, back)) < 1e-14
    assert max(off for off, _ in apart(document, there)) > 0.9
    assert there["cell"]["area"] == pytest.approx(1e-6 * document["cell"]["area"])


def test_the_solve_by_scipy_finds_where_a_body_lies_that_hangs_by_little():
    """A chain of springs 1 whose first end a spring of 1e-8 holds, and whose last end a force 1 pulls."""
    n, soft = 200, 1e-8
    chain = 2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    chain[0, 0], chain[-1, -1] = 1.0 + soft, 1.0
    u, _ = _solved(csr_matrix(chain), csr_matrix((0, n)), np.eye(n)[-1], np.zeros(0))
    assert np.abs(soft * (u - np.arange(n)) - 1.0).max() < 1e-6


def test_the_solve_by_scipy_notices_a_wrong_stress_and_energy(solved):
    _, folder = solved(is_load)
    cell = SolvedAnew(folder)
    right = cell.compare(0)
    cell.file.close()
    assert max(right.stress, right.energy, right.contact) < 1e-8
    with h5py.File(folder / "result.h5", "r+") as file:
        file[STATE].attrs["stress"] = file[STATE].attrs["stress"] * (1 + WRONG)
    cell = SolvedAnew(folder)
    cell.document["load"]["stored"] *= 1 + WRONG
    wrong = cell.compare(0)
    assert wrong.stress == pytest.approx(WRONG, rel=0.01) and wrong.energy == pytest.approx(WRONG, rel=0.01)


@pytest.mark.parametrize(("part", "factor", "noticed"), [("sliding", -1, "friction"), ("jump", 1.01, "stress")])
def test_the_solve_by_scipy_notices_faces_that_slide_otherwise(solved, part, factor, noticed):
    _, folder = solved(rubs)
    name = f"state/{LAST}/{part}"
    for expected, scale in ((True, 1), (False, factor), (True, 1 / factor)):
        with h5py.File(folder / "result.h5", "r+") as file:
            file[name][...] = file[name][()] * scale
        cell = SolvedAnew(folder)
        found = cell.compare(LAST)
        cell.file.close()
        assert (max(vars(found).values()) < 1e-8) == expected and (getattr(found, noticed) < 1e-4) == expected


def test_the_solve_by_scipy_notices_other_damage(solved):
    _, folder = solved(is_soft)
    with h5py.File(folder / "result.h5", "r+") as file:
        partly = {
            n: np.count_nonzero((d > 0) & (d < 1)) for n in file["state"] for d in [file[f"state/{n}/damage"][()]]
        }
        number = max(partly, key=partly.get)
        assert partly[number] > 5
        damage = file[f"state/{number}/damage"]
        for factor, noticed in ((1.0, False), (LESS, True), (1 / LESS, False)):
            damage[...] = damage[()] * factor
            file.flush()
            cell = SolvedAnew(folder)
            found = cell.compare(int(number))
            cell.file.close()
            assert (max(found.stress, found.energy) > 1e-8) == noticed


def test_brute_force_notices_a_wrong_path(solved):
    drawn, folder = solved(is_soft)
    base = document_of(folder)
    assert is_affordable(drawn, base)
    points = followed(drawn, base, folder)
    assert points_compared(base, points, folder).deviation < 1e-11
    for name in ("stress", "fracture_energy", "dissipated"):
        wrong = put(base, f"path[].{name}", len(base["path"]) - 1)
        assert points_compared(wrong, points, folder).deviation > 1e-5 * WRONG, name
    fewer = base | {"path": [base["path"][0] | {"softened": base["path"][0]["softened"] + 1}, *base["path"][1:]]}
    assert points_compared(fewer, points, folder).deviation == DIFFERENT


def test_streams_of_a_case_do_not_depend_on_others():
    assert stream(1, 2, 0).random() == stream(1, 2, 0).random() != stream(1, 2, 1).random()


def test_a_case_in_other_units_and_in_another_order(tmp_path: Path):
    document = draw(SEED, 0, tmp_path).document | {
        "cell": {"geometry": "table", "width": 2.0, "fibre_list": [{"x": 1.0, "a": 0.5}, {"x": 0.5, "phase": "void"}]},
        "interface": {"toughness": 3.0, "normal_stiffness": 5.0, "debonded": [{"fibre": 1, "centre": 7.0}]},
    }
    other = transforms.in_units(document, Units(10.0, 100.0))
    assert other["cell"]["fibre_list"][0] == {"x": 100.0, "a": 50.0} and other["cell"]["width"] == 200.0
    assert other["interface"]["toughness"] == 3000.0 and other["interface"]["normal_stiffness"] == 0.5
    assert other["interface"]["debonded"] == document["interface"]["debonded"]
    table = {"openings": [2.0, 3.0], "tractions": [4.0, 0.0], "normal_toughness": 5.0, "mixing_exponent": 6.0}
    found = transforms.in_units(document | {"interface": table}, Units(10.0, 100.0))["interface"]
    assert found == {
        "openings": [200.0, 300.0], "tractions": [40.0, 0.0], "normal_toughness": 5000.0, "mixing_exponent": 6.0,
    }  # fmt: skip
    same, places = transforms.reordered(np.random.default_rng(3), document)
    assert places.fibres == [0] and same["interface"]["debonded"][0]["fibre"] == 1
    rows = [document["cell"]["fibre_list"][k] for k in places.rows]
    assert same["cell"]["fibre_list"] == rows != document["cell"]["fibre_list"]
    fibres = [{"number": 1, "row": places.rows.index(0) + 1}]
    assert transforms.relabelled({"solver": {}, "fibres": fibres}, places)["fibres"] == [{"number": 1, "row": 1}]
