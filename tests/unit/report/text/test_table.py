"""Tables as text and HTML: of points and envelopes, and of constants in space."""

import re
from typing import Any

import pytest

from feti_homog.report.text import constant_tables
from feti_homog.report.text.constant_tables import cell_constants, moduli, stiffnesses
from feti_homog.report.text.path_table import _path_energies, _peak_lines, jump_lines
from feti_homog.report.text.point_tables import components, envelope_table
from feti_homog.report.text.summary import STRESSES, phase_tables
from feti_homog.report.text.tables import Column, Table
from feti_homog.results.landmarks import marks, peak_of


def test_html_has_the_decimals_of_text_small_errors_and_notes():
    columns = [Column(""), Column("stiffness", 12, ".3f"), Column("value"), Column("error", 12, ".1e")]
    table = Table("t", columns, [["S11", 12.34567, 12.34567891, 4.6e-13], ["S12", 1e-6, 1e-15, 0.0], ["n", 3]])
    assert table.cells == [["S11", "12.346", "12.34568", "4.6e-13"], ["S12", "0.000", "0", "0.0e+00"], ["n", "3"]]
    html = Table("t", [Column("x")], [[1]], ["a < b"], ["c"]).html
    assert "<caption>t<small>a &lt; b</small><small>c</small></caption>" in html


def test_the_error_of_the_mesh_gives_the_digits_of_a_constant():
    document = {
        "case": {"output": {"stress_unit": "GPa"}},
        "effective_stiffness": [[11.8501, 5.4, 1e-6], [5.4, 11.85, 0.0], [1e-6, 0.0, 3.2]],
        "moduli": {"E1": 9.379948, "nu12": 0.4565729, "G12": 3.220756},
        "mesh_error": {"constants": {"E1": 0.01234347, "nu12": 0.0008491602}},
    }
    table = moduli(document)
    assert table.cells == [["E1", "9.380", "+- 0.012"], ["nu12", "0.45657", "+- 0.00085"], ["G12", "3.220756", ""]]
    assert stiffnesses(document)[0].cells[2] == ["S12", "0.000001", "0.000000", "3.200000"]


def test_rows_abreast_and_columns_in_blocks():
    rows = [["a", 1, "+- 2"], ["bc", 3, ""], ["d", 5, "+- 6"]]
    columns = [Column("", -4, indent=0), Column("value", 6, "d"), Column("error", -6, indent=1)]
    assert Table("t", columns, rows, ["above"], ["below"], abreast=2).lines == [
        "t", "above", "  a        1 +- 2     bc       3", "  d        5 +- 6", "below",
    ]  # fmt: skip
    table = Table("t", [Column("", -4), *map(Column, "xyz")], [["p", 1, 2, "-"], ["q", "-", "-", 3]], most_columns=2)
    assert [line.split() for line in table.lines] == [["t"], ["x", "y"], ["p", "1", "2"], ["z"], ["q", "3"]]
    assert table.cells == [["p", "1", "2", "-"], ["q", "-", "-", "3"]] and table.html.count("<tr>") == 4
    assert table.html.count("<table>") == table.html.count("<thead>") == 2 and table.html.count("<caption>") == 1


def document(count: int, names: tuple[str, ...], without: tuple[int, ...] = (), **section: Any) -> dict[str, Any]:
    """Return an envelope of so many directions, some of them without an onset."""
    points: list[dict[str, Any]] = []
    for number in range(count):
        point: dict[str, Any] = {"angle": 360.0 * number / count}
        if number not in without:
            point |= {"factor": 10.0 + number, "fibre": 2, "bond_angle": -12.5} | dict.fromkeys(names, 0.25)
        points.append(point)
    return {
        "case": {"envelope": {"plane": ["S22", "S12"]} | section, "output": {"stress_unit": "MPa"}},
        "envelope": points,
    }


def test_the_least_and_the_largest_load_and_some_directions():
    whole = document(72, ("normal", "tangential", "axial"))
    lines = envelope_table(whole).lines
    assert lines[0] == "Onset of debonding or softening in the plane S22, S12 (MPa): 72 directions"
    assert lines[1].split() == ["least", "10", "at", "0", "degrees"]
    assert lines[2].strip() == "largest  81 at 355 degrees"
    assert len(lines) == 5 + 12 and max(map(len, lines)) < 80
    assert lines[3].endswith(" (degrees), traction / strength")
    assert lines[4].split() == ["angle", "S22", "S12", "fibre", "at", "normal", "tangent", "axial"]
    assert lines[5].split() == ["0", "10", "0", "2", "-12.50", "0.25", "0.25", "0.25"]


def test_directions_without_an_onset_are_counted():
    lines = envelope_table(document(8, ("psi",), without=(0, 3), temperature=-50.0)).lines
    assert lines[0].endswith("8 directions, after a temperature of -50")
    assert lines[1].strip() == "no load breaks a bond in 2 of them"
    assert lines[6].split() == ["0", "none", "none"] and lines[5].split()[-1] == "psi"
    assert lines[4].endswith(" (degrees), psi of its traction")


def test_strains_have_no_unit_and_nothing_may_break():
    lines = envelope_table(document(4, (), without=(0, 1, 2, 3))).lines
    assert len(lines) == 2
    whole = document(4, ("psi",))
    whole["case"]["envelope"]["plane"] = ["E11", "gamma12"]
    assert envelope_table(whole).lines[0] == "Onset of debonding or softening in the plane E11, gamma12: 4 directions"


@pytest.mark.parametrize(("angle", "expected"), [(0.0, (3.0, 0.0)), (90.0, (0.0, 3.0)), (180.0, (-3.0, 0.0))])
def test_what_rounding_leaves_of_zero_is_zero(angle, expected):
    assert components({"angle": angle, "factor": 3.0}) == pytest.approx(expected, abs=1e-300)


@pytest.mark.parametrize(
    ("unit", "head"), [("", "at x, y"), ("um", "at x, y (µm)"), ("micrometres", "at x, y (micrometres)")]
)
def test_places_of_largest_stresses_are_coordinates_with_a_unit(unit, head):
    measures = (*STRESSES, "utilisation")
    phase = {"phase": "fibre", "state": ["E11"], "criterion": "principal"} | {name: [2.0] for name in measures}
    phase |= {f"{name}_at": [[0.25, 0.5]] for name in measures}
    document = {"case": {"output": {"length_unit": unit}}, "phase_stresses": [phase], "cell": {"width": 1.0}}
    largest, used = phase_tables(document)
    assert (
        largest.below == []
        and "about 5 % in the root" in phase_tables(document | {"mesh_error": {"energy": 25e-4}})[0].below[0]
    )
    assert [column.name for column in largest.columns[2::2]] == [head] * 3 and used.columns[3].name == head
    for table in (largest, used):
        heads, (cells,) = table.lines[1], table.lines[2:3]
        assert heads.index(head) + len(head) == cells.index("0.25, 0.5") + len("0.25, 0.5")
    for width, place, words in (
        (60.0, (1250.1234, 830.0), "1250.12, 830"),
        (2e-5, (1.23456e-5, -1e-12), "1.235e-05, 0"),
    ):
        far = phase | {name: [place] for name in phase if name.endswith("_at")}
        (row,) = phase_tables(document | {"phase_stresses": [far], "cell": {"width": width}})[0].cells
        assert row[2] == words


CELL = {"E_axial": 41.7, "G_transverse": 3.7, "expansion_axial": None, "deviation": 0.002}
AXES = dict.fromkeys(("E1", "E2", "E3", "nu12", "nu13", "nu23", "G12", "G13", "G23"), 1.5)


def test_the_range_over_directions_stands_above_the_table_if_there_is_one():
    assert cell_constants({"case": {}}) == []
    across = {"E_least": 9.81, "E_largest": 10.93, "G_least": 3.3, "G_largest": 3.82}
    (table,) = cell_constants({"case": {}, "transversely_isotropic": CELL, "transverse_moduli": across})
    assert table.lines[1] == "  over all directions across: E from 9.81 to 10.93, G from 3.3 to 3.82"


def test_a_row_for_each_source_and_a_column_for_each_constant_that_one_knows():
    estimates = {"halpin_tsai": {"E_axial": 41.6, "G_transverse": None}, "chamis": {"E_axial": None}}
    document = {"constants": AXES, "transversely_isotropic": CELL, "estimates": estimates}
    document["fibre_bounds"] = {"E_axial": [40.0, 43.0], "nu_axial": None}
    document["case"] = {"output": {"stress_unit": "GPa"}}
    axes, table = (each.lines for each in cell_constants(document))
    assert len(axes) == 4 and axes[0].endswith("(GPa)")
    assert "0.2 %" in table[0] and table[1].split() == ["E_axial", "G_transverse"]
    assert [line.split()[-2:] for line in table[2:-1]] == [
        ["41.7", "3.7"], ["41.6", "-"], ["40", "-"], ["43", "-"],
    ]  # fmt: skip
    assert len({len(line) for line in table[1:-1]}) == 1
    assert table[-1].strip().startswith("-: not available from this method")


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"case": {"material": {"coating": {}}}}, "fibres without coatings"),
        ({"cell": {"porosity": 0.1}}, "cells without voids"),
        ({"case": {"interface": [{}, {}]}}, "round fibres that are bonded, all alike"),
        ({"cell": {"fractions": {"matrix": 1.0}}}, "composites"),
        ({}, "round fibres"),
    ],
)
def test_a_cell_without_estimates_is_reported_of_what_they_are(more, words):
    (table,) = cell_constants({"case": {}, "transversely_isotropic": CELL, **more})
    assert table.lines[-1] == f"  closed-form estimates exist for {words} only"


def test_heads_of_thermal_constants_stand_apart() -> None:
    """Stresses of both signs with errors: each head is a word of its own, and each error beside its constant."""
    values = {name: [k + 1.0] * 6 for k, name in enumerate(constant_tables.THERMAL)}
    errors = {name: [0.1 * (k + 1)] * 6 for k, name in enumerate(constant_tables.THERMAL)}
    (table,) = constant_tables.thermal({"case": {}, "mesh_error": errors} | values)
    heads = [head for title in constant_tables.THERMAL.values() for head in (title, "mesh error")]
    assert re.split(r" {2,}", table.lines[1].strip()) == heads
    assert table.cells[0] == ["11", "1", "1.0e-01", "2", "2.0e-01", "3", "3.0e-01"]


def test_what_is_left_is_that_after_the_peak() -> None:
    """Bonds that soften break after the peak, so that "after it" would be read as after the first break."""
    peak: dict[str, Any] = {
        "stress_name": "S11", "strain_name": "E11", "stress": 40.0, "strain": 0.006, "event": 1, "stress_left": 20.0,
        "event_left": 3, "first_break_stress": 30.0, "first_break_strain": 0.005, "first_break_event": 2,
    }  # fmt: skip
    case = {"analysis": {"plane": "strain"}, "path": {"method": "events", "strain": [1.0, 0.0, 0.0]}}
    case["output"] = {"stress_unit": "MPa"}
    point = {"load_factor": 1.0, "broke": 0, "strain": [0.0, 0.0, 0.0], "stress": [0.0, 0.0, 0.0]}
    lines = _peak_lines({"case": case, "path": [point] * 4}, peak)
    assert " ".join(" ".join(lines).split()) == (
        "Peak S11 (MPa): 40 at E11 = 0.006 (event 1); first break 30 at 0.005 (event 2); "
        "then falls by 50.0% to 20 as the strain rises (before event 3)"
    )


def along(stresses: list[float], broke: int = 0) -> dict[str, Any]:
    """Return a path to a strain of 0.01 with these stresses, whose last bonds break under the last but one."""
    n = len(stresses)
    points = [
        {"load_factor": k / n, "strain": [0.01 * k / n, 0.0, 0.0], "stress": [s, 0.0, 0.0], "broke": broke * (k < n)}
        for k, s in enumerate(stresses, start=1)
    ]
    case = {"analysis": {"plane": "strain"}, "path": {"method": "increments", "strain": [0.01, 0.0, 0.0]}}
    return {"case": case, "path": points}


@pytest.mark.parametrize(
    ("stresses", "broke", "begins", "ends", "mark"),
    [
        ([30, 51.95, 51.75], 0, "Largest S11: 51.95 at", "; the path ends near its peak, 0.4% below it",
         "largest stress"),
        ([-30, -51.95, -51.75], 0, "Largest S11: -51.95 at", "near its peak, 0.4% below it", "largest stress"),
        ([30, 100, 96], 1, "Largest S11: 100 at", "; then falls by 4.0% to 96 (increment 2); the path "
         "ends near its peak, 4.0% below it", "largest stress"),
        ([30, 100, 94], 1, "Peak S11: 100 at", "; then falls by 6.0% to 94 (increment 2)", "peak"),
        ([10, 60, 40, 59], 1, "Peak S11: 60 at", "; then falls by 33.3% to 40 (increment 2)", "peak"),
        ([10, 60, 40, 90], 1, "Peak S11: 60 at", "; then falls by 33.3% to 40 (increment 2); later 90 "
         "(increment 3)", "peak"),
        ([10, 20, 30], 0, "S11 at the end of the path, no peak yet: 30 at", "(increment 2)", "largest stress and end"),
        # Small early falls are saw teeth of a path that rises beyond them, and the end counts, not the valley.
        ([50, 60, 58, 104], 1, "S11 at the end of the path, no peak yet: 104 at", "(increment 0)",
         "largest stress and end"),
        ([50, 60, 58, 104, 100, 102], 1, "Largest S11: 104 at", "; then falls by 3.8% to 100 (increment 4); the path "
         "ends near its peak, 1.9% below it", "largest stress"),
        ([50, 60, 58, 104, 30, 50, 49], 1, "Peak S11: 104 at", "; then falls by 71.2% to 30 (increment 4)", "peak"),
        ([10, 30, -30], 0, "Peak S11: 30 at", "E11 = 0.00666667 (increment 1)", "peak"),
    ],
)  # fmt: skip
def test_a_peak_is_a_stress_after_which_the_path_falls(stresses, broke, begins, ends, mark) -> None:
    document = along([float(stress) for stress in stresses], broke)
    peak = peak_of(document)
    words = " ".join(" ".join(_peak_lines(document, peak)).split())
    assert words.startswith(begins) and words.endswith(ends)
    assert marks(document)[peak["event"]].removeprefix("first break and ") == mark
    assert words.count("; first break in the step to") == broke  # the stress behind the breaks of an increment


def test_a_strain_that_jumps_under_a_given_stress_is_reported() -> None:
    """Two of four points have one load; under a given strain the stress would fall there."""
    document = along([10.0, 20.0, 20.0, 30.0], 1)
    document["case"]["path"] = {"method": "events", "to": {"S11": 30.0}}
    for point, load, strain in zip(document["path"], (0.3, 0.6, 0.6, 1.0), (1e-3, 2e-3, 7e-3, 9e-3), strict=True):
        point |= {"load_factor": load, "strain": [strain, 0.0, 0.0]}
    lines = jump_lines(document, peak_of(document))
    assert lines == ["E11 jumps from 0.002 to 0.007 at S11 = 20: prescribe E11 for the peak"]
    document["path"][2]["strain"][0] = 2.05e-3
    assert jump_lines(document, peak_of(document)) == []


@pytest.mark.parametrize("status", [{"unfinished": "by a limit"}, {}])
def test_an_unfinished_path_has_its_largest_stress_so_far_at_the_largest(status: dict[str, str]) -> None:
    """So has a path that ended below its load without a fall."""
    document = along([10.0, 60.0, 40.0 if status else 60.0, 90.0, 0.0], 1) | status
    del document["path"][-1]
    words = " ".join(" ".join(_peak_lines(document, peak_of(document))).split())
    assert words.startswith("Largest S11 so far, the path being cut off: 90 at")
    assert "; then" not in words and "; later" not in words


def test_the_last_closed_loop_of_friction_is_between_ends_of_legs() -> None:
    """Down and up twice, with two points at the second waypoint: the first, third and fifth leg end at one strain."""
    document, unloaded = along([0.0] * 11), {"stored": 0.0, "stored_in_springs": 0.0, "dissipated": 0.0}
    waypoints = [[0.01, 0, 0], [0.0, 0, 0], [0.01, 0, 0], [0.005, 0, 0], [0.01, 0, 0]]
    document["case"]["path"] = {"method": "increments", "waypoints": waypoints}
    strains, loads = (5, 10, 5, 0, 0, 5, 10, 8, 5, 8, 10), (0.5, 1.0, 1.5, 2.0, 2.0, 2.5, 3.0, 3.5, 4.0, 4.5, 5.0)
    for k, (strain, load, point) in enumerate(zip(strains, loads, document["path"], strict=True)):
        counts = {"bonded": 0, "open": 0, "closed": 1, "debonded_share": 1.0, "dissipated_strain_controlled": 0.0}
        energies = unloaded | {"friction_heat": 0.25 * k, "work": 1.0 + k * k}
        point |= energies | counts | {"strain": [strain / 1000, 0.0, 0.0], "load_factor": load / 5}
    assert "Heat of friction per area (MPa): 2.5, area of the last closed loop 64" in _path_energies(document, " (MPa)")
    for point in document["path"]:
        point["temperature"] = 30.0 * point["load_factor"]
    assert "Heat of friction per area (MPa): 2.5" in _path_energies(document, " (MPa)")
