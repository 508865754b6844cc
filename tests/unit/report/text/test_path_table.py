"""The line of a peak: what each of its numbers is."""

from __future__ import annotations

from typing import Any

from feti_homog.report.text.path_table import _peak_lines


def test_what_is_left_is_that_after_the_peak() -> None:
    """Bonds that soften break after the peak, so that "after it" would be read as after the first break."""
    peak: dict[str, Any] = {
        "stress_name": "S11", "strain_name": "E11", "stress": 40.0, "strain": 0.006, "event": 1, "stress_left": 20.0,
        "event_left": 3, "first_break_stress": 30.0, "first_break_strain": 0.005, "first_break_event": 2,
    }  # fmt: skip
    case = {"analysis": {"plane": "strain"}, "path": {"method": "events", "strain": [1.0, 0.0, 0.0]}}
    lines = _peak_lines({"case": case, "path": [{}] * 4}, peak, " (MPa)")
    assert " ".join(" ".join(lines).split()) == (
        "Peak S11 (MPa): 40 at E11 = 0.006 (point 1); first break 30 at 0.005 (point 2); "
        "20 after the peak as the strain rises, 50.0% less (point 3)"
    )
