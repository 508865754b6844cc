"""The printed tables of points: those of an envelope and of an angle."""

from typing import Any

import pytest

from feti_homog.report.text.point_tables import angle_table, components, envelope_table


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
    assert lines[0] == "Onset of debonding in the plane S22, S12 (MPa): 72 directions"
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
    assert envelope_table(whole).lines[0] == "Onset of debonding in the plane E11, gamma12: 4 directions"


@pytest.mark.parametrize(("angle", "expected"), [(0.0, (3.0, 0.0)), (90.0, (0.0, 3.0)), (180.0, (-3.0, 0.0))])
def test_what_rounding_leaves_of_zero_is_zero(angle, expected):
    assert components({"angle": angle, "factor": 3.0}) == pytest.approx(expected, abs=1e-300)


def test_counts_of_nodes_of_an_angle_name_their_unit_strain():
    """Each of the three unit strains opens and closes other nodes."""
    counts = {"angle": 90.0, "bonded": 9, "open": 2, "closed": 1}
    words = "bonded, open, closed: interface nodes under the unit strain gamma12"
    stiffness, stress = {"stiffness": [[9.0, 2, 0], [2, 8, 0], [0, 0, 3]]}, {"stress": [1.0, 2.0, 3.0]}
    assert words in angle_table({"case": {}, "angle": [counts | stiffness]}).lines
    assert words not in angle_table({"case": {}, "angle": [counts | stress]}).lines
