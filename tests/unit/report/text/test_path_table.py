"""The line of a peak: what each of its numbers is."""

from typing import Any

import pytest

from feti_homog.report.text.path_table import _path_energies, _peak_lines
from feti_homog.results.landmarks import marks, peak_of


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
        "then falls by 50.0% to 20 as the strain rises (event 3)"
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
        ([10, 60, 40, 90], 1, "Peak S11: 60 at", "; then falls by 33.3% to 40 (increment 2); later up to 90 "
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
