"""Paths on which all layers part and close again, against the closed form of layers that touch or part."""

import numpy as np
import pytest
from reference.parted_layers import PartedLayers
from support.layered_meshes import layers
from support.loaded_twins import EPOXY_GLASS, compare_paths, document
from support.ranks import assert_certified, write_once
from support.verified_results import falsified

from feti_homog import Case, run
from feti_homog.errors import ConvergenceError
from feti_homog.system.parallel.mpi_errors import on_root
from feti_homog.verify.certificate import verify
from feti_homog.verify.check_loads import at_points

pytestmark = [pytest.mark.parallel, pytest.mark.few_ranks]

EXACT = 1e-10
STRENGTH = {"normal_strength": 0.03, "tangential_strength": 0.04}
SPRINGS = {"normal_stiffness": 100.0, "tangential_stiffness": 30.0}
ENERGY = SPRINGS | {"criterion": "energy", "toughness": 1e-5}
WHOLE = {"debonded": [{"fibre": "all", "angle": 360.0}]}
PARTED = STRENGTH | WHOLE
INFLUENCE, LOOSE = {"feti_pc_type": "influence"}, {"feti_ksp_rtol": 1e-8}
TWO, SIX, NINE = "MFMM", "MMFFMMFM", "MMFMMFMMF"
BACK = [{"E11": 0.2}, {"E11": -0.1}]
AGAIN = [{"E22": 0.2}, {"E22": -0.1}, {"E22": 0.15}, {"E22": -0.05}]
PULLED = [{"E22": 0.2}, {"E22": -0.1, "S11": 0.1}]
PRESSED = [{"E11": 0.2}, {"S11": -0.1}, {"E11": 0.1}]
HELD = [{"E11": 0.2}, {"S22": 0.1}, {"S22": -0.1}, {"E11": -0.05}]
COOLED = [{"temperature": -50.0}, {"E11": 0.2}, {"E11": -0.1}]
STEPS = {"method": "increments", "increments": 11}

PATHS = {
    "back, to the default tolerance": (TWO, 0, "strain", STRENGTH, LOOSE, {"waypoints": BACK}),
    "far beyond the strength": (TWO, 0, "strain", STRENGTH, None, {"waypoints": [{"E11": 20.0}, {"E11": -1e-3}]}),
    "again and again": (SIX, 1, "stress", STRENGTH | SPRINGS, None, {"waypoints": AGAIN}),
    "parted from the start": (NINE, 1, "strain", PARTED, None, {"waypoints": AGAIN}),
    "pulled along": (SIX, 1, "generalized", ENERGY, INFLUENCE, {"waypoints": PULLED}),
    "pressed": (NINE, 0, "strain", STRENGTH, None, {"waypoints": PRESSED}),
    "pressed on springs": (TWO, 0, "stress", ENERGY | {"growth": "springs"}, None, {"waypoints": PRESSED}),
    "held and loaded along": (SIX, 0, "generalized", STRENGTH, None, {"waypoints": HELD}),
    "cooled": (TWO, 0, "generalized", STRENGTH, None, {"waypoints": COOLED}),
    "in steps": (SIX, 0, "stress", ENERGY, INFLUENCE, {"waypoints": BACK} | STEPS),
    "pressed in steps": (TWO, 0, "generalized", STRENGTH | SPRINGS, None, {"waypoints": PRESSED} | STEPS),
    "let go": (TWO, 0, "strain", STRENGTH, None, {"waypoints": [{"E11": 0.2}, {"S11": 0.0}, {"E11": -0.1}]}),
}


def solved(comm, folder, phases, across, plane, interface, petsc, materials=EPOXY_GLASS, pieces=None, **analysis):
    """Return the result of a case of layers, with its files in the folder. Collective."""
    write_once(comm, layers(phases, across), folder / "layers.msh")
    cell = {"geometry": "mesh", "file": "layers.msh"}
    case = document(cell, materials, plane, interface, petsc, **analysis)
    case["output"]["fields"], case["decomposition"] = True, {} if pieces is None else {"subdomains": pieces}
    return run(Case.parse(case, folder), comm, out=folder / "out")


def closed_form(phases, across, plane, interface):
    """Layers without bonds, whose faces touch through the springs of two interfaces each, if there are some."""
    share = phases.count("F") / len(phases)
    faces = 2 * sum(a != "F" and b == "F" for a, b in zip(phases, phases[1:] + phases[0], strict=True))
    give = faces / interface["normal_stiffness"] if "normal_stiffness" in interface else 0.0
    return PartedLayers(EPOXY_GLASS, (1 - share, share), plane, across, give)


@pytest.mark.one_rank
@pytest.mark.parametrize("name", PATHS)
def test_layers_part_close_and_part_again_exactly(comm, shared_path, name):
    phases, across, plane, interface, petsc, path = PATHS[name]
    result = solved(comm, shared_path, phases, across, plane, interface, petsc, path=path)
    oracle = closed_form(phases, across, plane, interface)
    points = [{"load_factor": p.load_factor, "strain": p.strain, "stress": p.stress, "broke": p.broke}
              | ({} if p.temperature is None else {"temperature": p.temperature}) for p in result.path]  # fmt: skip
    largest = [max(np.abs(getattr(p, what)).max() for p in result.path) for what in ("strain", "stress")]
    parted = touching = 0
    for point, load in zip(result.path, at_points(result.case, points), strict=True):
        if point.bonded:
            continue
        n = len(oracle.along) + 1
        given = {("S" if by_stress else "E") + f"{k}{k}": value * (abs(value) > EXACT * largest[int(by_stress)])
                 for k, value, by_stress
                 in zip((1, 2, 3)[:n], load.values, load.by_stress, strict=False)}  # fmt: skip
        strain, stress, touch = oracle.state(given, point.temperature or 0.0)
        strain = np.where(np.isnan(strain), point.strain[:n], strain)
        assert np.abs(point.strain[:n] - strain).max() < EXACT * largest[0]
        assert np.abs(point.stress - np.pad(stress, (0, len(point.stress) - n))).max() < EXACT * largest[1]
        parted, touching = parted + (not touch), touching + touch
    assert result.status == "done" and parted and touching and result.path[-1].bonded == 0
    assert_certified(comm, shared_path / "out")


@pytest.mark.one_rank
def test_a_loss_at_parting_that_is_none_is_noticed(comm, shared_path):
    solved(comm, shared_path, TWO, 0, "strain", STRENGTH, None, path={"waypoints": BACK})

    def holds(factor):
        def edit(document, _):
            for point in document["path"][1:]:
                lost = point["dissipated"] * (factor - 1)
                for name in ("work", "dissipated", "dissipated_strain_controlled"):
                    point[name] += lost

        findings = verify(falsified(shared_path / "out", shared_path / f"copy {factor}", edit)).findings
        return next(finding.holds for finding in findings if finding.name == "energy")

    assert on_root(comm, lambda: [holds(factor) for factor in (1.0, 1 - 1e-4, 1 + 1e-4)]) == [True, False, False]


def test_a_pull_on_parted_layers_is_reported_with_what_was_found(comm, shared_path):
    path = {"waypoints": [{"E11": 0.2}, {"S11": 0.1}]}
    with pytest.raises(ConvergenceError, match="nothing in the cell carries"):
        solved(comm, shared_path, TWO, 0, "strain", STRENGTH, None, path=path)


UNDETERMINED = {
    "pulled along": ("strain", {"S22": 0.1}, "E11, gamma12"),
    "pressed along, so that layers touch without a force": ("stress", {"S22": -0.1}, "E11, gamma12"),
    "pressed": ("strain", {"S11": -0.1}, "gamma12"),
    "in space": ("generalized", {"E11": 0.1, "E33": 0.01, "S22": 0.1}, "gamma13, gamma12"),
    "all named": ("generalized", {"E11": 0.1, "gamma12": 0.0, "gamma13": 0.0, "S22": 0.1}, None),
    "along the fibres too": ("generalized", {"S22": 0.1}, "E11, gamma13, gamma12"),
}
SOME = ("pressed", "in space")


@pytest.mark.one_rank
@pytest.mark.parametrize(
    ("name", "phases", "materials"),
    [*((name, TWO, EPOXY_GLASS) for name in UNDETERMINED), *((name, SIX, EPOXY_GLASS[:1] * 2) for name in SOME)],
)
def test_strains_that_nothing_determines_are_named(comm, shared_path, phases, materials, name):
    plane, to, names = UNDETERMINED[name]
    result = solved(comm, shared_path, phases, 0, plane, WHOLE, None, materials, len(phases), load={"to": to})
    undetermined = [remark for remark in result.remarks if "undetermined" in remark]
    assert [line.split(":")[0] for line in undetermined] == ([] if names is None else [f"[load] {names}"])


def test_layers_touch_where_the_strain_is_zero_and_their_undetermined_strains_are_counted(comm, shared_path):
    result = solved(comm, shared_path, TWO, 0, "strain", STRENGTH, None, path={"waypoints": BACK})
    _, _, turn, last = result.path
    assert abs(turn.load_factor - 5 / 6) < 1e-12 and last.open == 0
    assert any("[path] gamma12: undetermined at 3 of 4 points" in remark for remark in result.remarks)
    case = document({}, EPOXY_GLASS, "strain", WHOLE, load={"to": {"S22": 0.01}})
    assert not any("undetermined" in remark for remark in run(Case.parse(case), comm).remarks)


@pytest.mark.one_rank
@pytest.mark.parametrize("back", [{"E11": -0.01}, {"S11": -0.01}], ids=str)
def test_a_fibre_that_comes_free_is_pressed_again(comm, back):
    weak = {"normal_strength": 1e-4, "tangential_strength": 1e-4}
    case = {"cell": {"mesh_size": 0.45}, "phases": EPOXY_GLASS, "plane": "strain", "interface": weak}
    result, _ = compare_paths(comm, **case, path={"waypoints": [{"E11": 0.02}, back]})
    assert result.path[-1].bonded == 0 and result.path[-1].closed
