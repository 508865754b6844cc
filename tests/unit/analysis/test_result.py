"""Results: what is described is what is written, what is written is read again, and what is printed is short."""

import copy
import pickle
import re
from typing import Any

import numpy as np
import pytest
from manual_source.record_tables import schema_keys

from feti_homog import Result
from feti_homog.analysis.cell_records import CellInfo, Checks, SolverInfo, StiffnessBounds
from feti_homog.analysis.result_records import AnglePoint, LoadPoint, PathPoint, TipRates, Tips
from feti_homog.materials.engineering_constants import (
    engineering_constants,
    engineering_moduli,
    transversely_isotropic_part,
)
from feti_homog.materials.phase_bounds import Bounds
from feti_homog.results import result_json

STIFFNESS = np.array([[9.0, 2.0, 0.0], [2.0, 8.0, 0.0], [0.0, 0.0, 3.0]])
CELL = CellInfo(1.0, 2.0, 2.0, 0.4, {"matrix": 0.6, "fibre": 0.4}, 10, 20)
SOLVER = SolverInfo(1, 2, 3, 40, 50, 6, 7, 8, 3, 1, 1e-8, 3, (5, 6, 7), (2, 2, 2))
TIPS = TipRates(
    load=("E11", "E11"), fibre=(1, 1), angle=np.array([-45.0, 45.0]), G=np.array([3.0, 3.0]), G_I=np.array([1.0, 1.0]),
    G_II=np.array([2.0, 2.0]), psi=np.array([54.7, 54.7]), length=np.array([1e-3, 1e-3]),
)  # fmt: skip
DEBONDING = {"debonded_share": 0.5, "debonded_length": np.array([0.5, 0.0]), "debonding_angle": np.array([90.0, 0.0])}
COUNTS = {"bonded": 5, "open": 3, "closed": 1, "iterations": 7}


SPATIAL = np.diag([160.0, 150.0, 230.0, 54.0, 53.0, 46.0]) + np.outer(np.arange(6.0), np.arange(6.0))


def path_point(load: float) -> PathPoint:
    strain = np.array([load, 0.0, 0.0])
    return PathPoint(
        load_factor=load,
        strain=strain,
        stress=STIFFNESS @ strain,
        broke=1,
        free_motions=0,
        work=0.9,
        dissipated=0.5,
        dissipated_strain_controlled=0.6,
        stored=0.4,
        stored_in_springs=0.1,
        fracture_energy=0.4 * load,
        dissipation_ratio=None if load < 1 else 1.25,
        tips=None if load < 1 else Tips((1, 2), *np.arange(8.0).reshape(4, 2)),
        **DEBONDING,
        **COUNTS,
    )


def load_point() -> LoadPoint:
    return LoadPoint(
        strain=np.arange(6.0), stress=np.arange(6.0, 0.0, -1.0), temperature=-100.0, free_motions=0, stored=0.4,
        stored_in_springs=0.0, tips=TIPS, **DEBONDING, **COUNTS,
    )  # fmt: skip


def made(kind: str, **answer: Any) -> Result:
    case = {"name": "a", "analysis": {"type": kind, "plane": "strain"}, "output": {"stress_unit": "GPa"}}
    if kind == "path":
        case["path"] = {"method": "events", "strain": [1.0, 0.0, 0.0]}
    if kind == "load":
        case["analysis"]["plane"] = "generalized"
        case["load"] = {"to": {"S22": 50.0, "temperature": -100.0}}
    if "compliance" in answer:
        case["analysis"]["plane"] = "generalized"
    if "tips" in answer:
        case["interface"] = {"contact": True}
    return Result(
        version="0", case=case, digest="d", cell=CELL, solver=SOLVER, checks=Checks(1e-9, 2e-9, 3e-9, symmetry=1e-12),
        check_tolerance=1e-5, kkt_tolerance=1e-6, warnings=("w",), faults=(), status="done",
        timings={"mesh": 0.5, "solve": 1.0}, memory=1 << 20, **answer,
    )  # fmt: skip


RESULTS = {
    "stiffness": made(
        "stiffness", effective_stiffness=STIFFNESS, moduli=engineering_moduli(STIFFNESS),
        bounds=StiffnessBounds(voigt=2 * STIFFNESS, reuss=0.5 * STIFFNESS, hashin_shtrikman=Bounds((1, 9), (1, 4))),
    ),
    "anisotropic": made(
        "stiffness", effective_stiffness=STIFFNESS, moduli=engineering_moduli(STIFFNESS),
        bounds=StiffnessBounds(voigt=2 * STIFFNESS, reuss=0.5 * STIFFNESS, hashin_shtrikman=None),
    ),
    "space": made(
        "stiffness", effective_stiffness=SPATIAL, compliance=np.linalg.inv(SPATIAL), thermal_stress=np.arange(6.0),
        thermal_expansion=-np.linalg.solve(SPATIAL, np.arange(6.0)), constants=engineering_constants(SPATIAL),
        transversely_isotropic=transversely_isotropic_part(SPATIAL),
    ),
    "angle in space": made(
        "angle",
        angle=(AnglePoint(angle=9.0, stiffness=SPATIAL, thermal_stress=np.arange(6.0), **DEBONDING, **COUNTS),),
    ),
    "debonded": made("stiffness", effective_stiffness=STIFFNESS, tips=TIPS),
    "angle": made(
        "angle", angle=tuple(AnglePoint(angle=a, stiffness=STIFFNESS, **DEBONDING, **COUNTS) for a in (0.0, 90.0)),
    ),
    "angle with tips": made(
        "angle", angle=(AnglePoint(angle=90.0, stiffness=STIFFNESS, tips=TIPS, **DEBONDING, **COUNTS),),
    ),
    "load": made("load", load=load_point()),
    "path": made("path", path=(path_point(0.5), path_point(1.0)), resumed=0),
}  # fmt: skip


def leaves(value: Any, place: str = "") -> list[str]:
    """Return the places of all values of a document as `schema_keys` writes them."""
    if isinstance(value, dict):
        return [leaf for key, item in value.items() for leaf in leaves(item, f"{place}.{key}".lstrip("."))]
    if isinstance(value, list) and value and isinstance(value[0], dict):
        return [leaf for item in value for leaf in leaves(item, f"{place}[]")]
    return [place]


@pytest.mark.parametrize("name", RESULTS)
def test_every_key_that_is_written_is_described(tmp_path, name):
    result_json.write(tmp_path, RESULTS[name].document)
    known = {re.sub(r"\.[A-Z]+$", ".*", key.path) for key in schema_keys()}
    for place in leaves(result_json.read(tmp_path)):
        assert place in known or re.sub(r"\.[^.]+$", ".*", place) in known or place.startswith("case."), place


@pytest.mark.parametrize("name", RESULTS)
def test_what_is_written_is_read_again(tmp_path, name):
    result_json.write(tmp_path, RESULTS[name].document)
    again = Result.of(result_json.read(tmp_path))
    result_json.write(tmp_path / "again", again.document)
    assert (tmp_path / "again" / "result.json").read_bytes() == (tmp_path / "result.json").read_bytes()
    assert again.checks == RESULTS[name].checks and again.solver == SOLVER and again.fields is None


def test_descriptions_are_complete():
    described = list(schema_keys())
    assert all((key.meaning and key.type != "any") or key.path == "case.KEY" for key in described)
    by_path = {key.path: key for key in described}
    assert by_path["schema"].type == "integer" and by_path["timings.STAGE"].unit == "s"
    assert by_path["path[].stress"].type == "numbers (3,) or (6,)" and by_path["checks.hill"].type == "number"
    assert by_path["bounds.hashin_shtrikman.bulk"].unit and by_path["solver.iterations"].type == "list of integers"


@pytest.mark.parametrize(("kind", "points"), [(AnglePoint, RESULTS["angle"].angle), (PathPoint, RESULTS["path"].path)])
def test_columns_are_those_of_the_table(tmp_path, kind, points):
    header, *rows = result_json.write_csv(tmp_path / "table.csv", points).read_text().splitlines()
    described = [column.name for column in result_json.columns(kind)]
    written = header.split(",")
    assert [name for name in described if name in written] == written and len(rows) == len(points)
    assert not {"tips", "debonded_length", "fibre"} & {*written, *described}
    if kind is PathPoint:
        assert written[1:7] == ["E11", "E22", "gamma12", "S11", "S22", "S12"] and "free_motions" in written
        column = written.index("dissipation_ratio")
        assert [row.split(",")[column] for row in rows] == ["", "1.25"]


def test_columns_of_the_state_under_a_load(tmp_path):
    header, row = result_json.write_csv(tmp_path / "load.csv", [load_point()]).read_text().splitlines()
    written = dict(zip(header.split(","), row.split(","), strict=True))
    assert written["gamma13"] == "4.0" and written["S33"] == "4.0" and written["temperature"] == "-100.0"
    assert "tips" not in written and written["open"] == "3"


def test_columns_of_long_fibres(tmp_path):
    C = np.arange(36.0).reshape(6, 6)
    point = AnglePoint(angle=0.0, stiffness=C, thermal_stress=-np.arange(6.0), **DEBONDING, **COUNTS)
    header, row = result_json.write_csv(tmp_path / "table.csv", [point]).read_text().splitlines()
    written = dict(zip(header.split(","), row.split(","), strict=True))
    assert len(written) == len(header.split(","))
    assert [float(written[f"C{i}{j}"]) for i in range(1, 7) for j in range(1, 7)] == C.ravel().tolist()
    assert written["thermal_S11"] == "-0.0" and float(written["thermal_S12"]) == -5.0
    assert written.keys() <= {column.name for column in result_json.columns(AnglePoint)}


def test_points_are_arrays():
    points = RESULTS["path"].points
    assert points["strain"].shape == (2, 3) and points["load_factor"].tolist() == [0.5, 1.0]
    assert RESULTS["angle"].points["stiffness"].shape == (2, 3, 3) and "strain" not in RESULTS["angle"].points
    assert not RESULTS["stiffness"].points and "tips" not in points
    np.testing.assert_array_equal(points["dissipation_ratio"], [np.nan, 1.25])
    assert points["debonded_length"].shape == (2, 2)


def test_tips_are_records_and_no_cells_of_a_table(tmp_path):
    result_json.write(tmp_path, RESULTS["angle with tips"].document)
    (point,) = Result.of(result_json.read(tmp_path)).angle
    assert point.tips.load == TIPS.load and point.tips.fibre == TIPS.fibre and np.array_equal(point.tips.G, TIPS.G)
    assert RESULTS["angle"].angle[0].tips is None and "tips" not in RESULTS["angle with tips"].points
    assert "tips" not in result_json.write_csv(tmp_path / "table.csv", RESULTS["angle with tips"].angle).read_text()
    by_path = {key.path: key for key in schema_keys()}
    assert by_path["tips.G"].unit == by_path["angle[].tips.G"].unit == "stress times length"


def test_results_can_be_told_apart():
    """Compared as objects: their arrays have no single answer."""
    result = RESULTS["stiffness"]
    assert result == result and result != Result.of(result.document) and len({*RESULTS.values()}) == len(RESULTS)


def test_constants_are_attributes():
    """Young's moduli and ratios follow from the inverse stiffness."""
    for result, C in ((RESULTS["stiffness"], STIFFNESS), (RESULTS["space"], SPATIAL)):
        S = np.linalg.inv(C)
        expected = [1 / S[0, 0], -S[1, 0] / S[0, 0], 1 / S[-1, -1]]
        assert [result.E1, result.nu12, result.G12] == pytest.approx(expected, rel=1e-12)
    assert RESULTS["space"].E_axial == RESULTS["space"].transversely_isotropic.E_axial
    copied = pickle.loads(pickle.dumps(copy.copy(RESULTS["stiffness"])))
    assert copied.E1 == RESULTS["stiffness"].moduli.E1 and copied.fields is None


@pytest.mark.parametrize(
    ("name", "word", "hint"),
    [
        ("stiffness", "E", "did you mean E1?"),
        ("stiffness", "effective_stifness", "did you mean effective_stiffness?"),
        ("stiffness", "fibre_fraction", "it belongs to result.cell"),
        ("stiffness", "E_axial", "expected one of E1, E2, nu12, "),
        ("path", "E1", "expected one of schema, version, "),
    ],
)
def test_an_unknown_attribute_names_where_it_is(name, word, hint):
    with pytest.raises(AttributeError, match=f"^this result has no {word}: {re.escape(hint)}"):
        getattr(RESULTS[name], word)


@pytest.mark.parametrize("name", RESULTS)
def test_what_is_printed_is_short(name):
    text = str(RESULTS[name])
    # In space with the constants in the axes of the material and in those of the cell.
    assert len(text.splitlines()) < (45 if name == "space" else 40) and "largest relative error 3.0e-09 (jump)" in text
    assert text.splitlines()[-1].split() == ["Status", "done"]


def test_tables_for_notebooks():
    html = RESULTS["stiffness"]._repr_html_()
    assert html.count("<table>") == html.count("</table>") == 4
    assert all(
        words in html
        for words in (
            "Effective stiffness (GPa)",
            ">gamma12</th>",
            "Engineering moduli (GPa)",
            "Bounds (GPa)",
            "<p>done</p>",
        )
    )
    assert ">load</th>" in RESULTS["path"]._repr_html_()
