"""The branch of a path that a rising load follows, its components, and which of its points are chosen."""

from typing import Any

import numpy as np
import pytest

from feti_homog.results.landmarks import chosen, chosen_states, marks, peak_of
from feti_homog.results.path_curves import (
    changed_components,
    ends_of_legs,
    first_leg,
    largest_of_legs,
    leading_component,
    named_components,
    rising_strain,
    shown_components,
    targets,
    what_rises,
)


def point(load: float, stiffness: float, broke: int = 1) -> dict[str, Any]:
    strain = 0.1 * load
    stress = [stiffness * strain, 0.0, 0.0]
    return {"load_factor": load, "strain": [strain, 0.0, 0.0], "stress": stress, "broke": broke, "dissipated": 0.0}


def document(method: str, waypoints: int, points: list[dict[str, Any]]) -> dict[str, Any]:
    given = {"waypoints": [[1.0, 0, 0]] * waypoints} if waypoints > 1 else {"strain": [1.0, 0, 0]}
    case = {"analysis": {"plane": "strain"}, "path": {"method": method} | given}
    return {"case": case, "path": points}


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_peak_is_the_largest_stress_with_the_first_break_and_what_is_left(sign: float) -> None:
    """Snap-back: under a rising strain the stress falls to the branch of point 4, then of point 5."""
    points = [point(0.2, 9.0), point(0.5, 10.0), point(0.3, 8.0), point(0.4, 6.0), point(0.8, 4.0), point(1.0, 2.0, 0)]
    for number, each in enumerate(points):
        each |= {"dissipated": 0.1 * number, "broke": int(number not in (0, 5))}
        each |= {name: [sign * value for value in each[name]] for name in ("strain", "stress")}
    path = document("events", 1, points)
    expected = {"stress": 0.5 * sign, "strain": 0.05 * sign, "event": 1, "first_break_stress": 0.5 * sign}
    expected |= {"first_break_event": 1, "stress_left": 0.16 * sign, "event_left": 5, "dissipated": 0.1}
    expected |= {"first_break_strain": 0.05 * sign}
    assert peak_of(path) == {"strain_name": "E11", "stress_name": "S11"} | {
        name: pytest.approx(value) for name, value in expected.items()
    }
    assert marks(path) == {1: "first break and peak", 5: "after the peak and end"}
    assert {1, 4, 5} <= set(chosen(path, 5))


def test_the_peak_is_before_the_deepest_fall_in_which_bonds_break() -> None:
    """The matrix alone stiffens the cell again, and unloading breaks nothing."""
    stresses, broke = [2.0, 1.9, 1.95, 0.7, 4.0, 0.5], [1, 1, 1, 1, 0, 0]
    points = [point(n / 6, 60 * s / n, b) for n, (s, b) in enumerate(zip(stresses, broke, strict=True), 1)]
    found = peak_of(document("increments", 1, points))
    assert (found["event"], found["event_left"], found["stress"]) == (0, 3, pytest.approx(2.0))


def test_the_deepest_fall_is_below_the_largest_stress_before_it() -> None:
    """Saw teeth divide the fall, and the last fall is deeper than each tooth."""
    teeth = [10.0, 27.0, 23.0, 25.0, 20.7, 31.0, 39.5, 35.1, 38.8]
    points = [point(n / 9, 90 * s / n) for n, s in enumerate(teeth, 1)]
    found = peak_of(document("increments", 1, points))
    assert (found["event"], found["event_left"], found["stress_left"]) == (1, 4, pytest.approx(20.7))


def test_an_unloading_leg_changes_no_peak() -> None:
    """Under events, also with a snap-back below the valley of the rising load."""
    loads = [(0.2, 9.0), (0.5, 10.0), (0.1, 8.0), (0.6, 6.0), (1.0, 5.5)]
    points = [point(load, stiffness) for load, stiffness in loads]
    one = peak_of(document("events", 1, points))
    halves = [each | {"load_factor": each["load_factor"] / 2} for each in points]
    two = document("events", 2, [*halves, point(1.0, 0.0, 0)])
    assert peak_of(two) == one and one["event_left"] == 3


def test_rising_strain_is_that_of_the_first_leg() -> None:
    points = [point(load, 1.0) for load in (0.2, 0.5, 0.6, 1.0)]
    assert [first_leg(document("events", n, points)) for n in (1, 2, 3)] == [4, 2, 1]
    assert first_leg(document("increments", 2, points)) == 4
    found = rising_strain(document("increments", 1, [point(0.5, 4.0), point(1.0, 2.0)]))
    np.testing.assert_allclose(found[:, [3, 0]], [[0, 0], [0.05, 0.2], [0.1, 0.2]])
    assert rising_strain(document("events", 2, [point(1.0, 2.0)])) is None
    path = mixed({"S11": 1.0}, [[t, 0, 0] for t in (0.5, 1.0)], "strain")
    path["path"][0]["strain"][0] = 5.0
    assert rising_strain(path) is None


def test_the_ends_of_legs_are_drawn() -> None:
    """Bonds break on the first leg alone; the second goes back."""
    points = [point(0.01 * n, 1.0, broke=int(n < 50)) for n in range(1, 101)]
    numbers = chosen(document("events", 2, points), 5)
    assert {0, 49, 99} <= set(numbers) and ends_of_legs(document("events", 2, points)) == [49, 99]
    # If there are too many, bonds alone decide.
    assert chosen(document("events", 50, points), 5)[-1] == 99 and len(chosen(document("events", 50, points), 5)) <= 5


def test_of_points_with_fields_those_are_drawn_that_share_the_broken_bonds_evenly() -> None:
    points = [point(0.5, 1.0) for _ in range(101)]
    kept = [0, 1, 2, 48, 75, 99, 100]
    result = document("events", 1, points)
    assert chosen(result, 5, kept) == [0, 2, 48, 75, 100]
    assert chosen(result, 10, kept) == kept
    result["states"] = kept
    assert chosen_states(result, 5, 7) == [0, 2, 3, 4, 6]
    # Of a file that ends early there is what there is.
    assert chosen_states(result, 5, 3) == [0, 1, 2]
    assert chosen_states(document("events", 1, points[:3]), 5, 3) == [0, 1, 2]


COMPLIANCE = np.diag([2.0, 3.0, 1.0, 6.0, 7.0, 5.0]) - 0.5 * (np.ones((6, 6)) - np.eye(6)) * (np.arange(6) < 3)


def mixed(waypoints: Any, stresses: Any, plane: str = "generalized", **more: Any) -> dict[str, Any]:
    """Return a path through stresses (n, 6) or (n, 3) of one elastic law.

    Components in the plane are the first, second and last.
    """
    stresses = np.array(stresses, float)
    places = list(range(6)) if plane == "generalized" else [0, 1, 5]
    law = COMPLIANCE[np.ix_(places, places)]
    points = [
        {"load_factor": t, "strain": (law @ s).tolist(), "stress": s.tolist(), "broke": 0} | more
        for t, s in zip(np.linspace(0.0, 1.0, len(stresses) + 1)[1:], stresses, strict=True)
    ]
    given = {"to": waypoints} if isinstance(waypoints, dict) else {"waypoints": waypoints}
    return {"case": {"analysis": {"plane": plane}, "path": {"method": "events"} | given}, "path": points}


def test_what_a_waypoint_does_not_name_stays_and_the_components_that_change_are_named() -> None:
    path = mixed([{"temperature": -100.0}, {"S22": 60.0}, {"E22": 0.01}], [[0] * 6, [0, 60, 0, 0, 0, 0]])
    assert targets(path)[1]["temperature"] == -100.0 and targets(path)[1]["S13"] == 0.0
    assert changed_components(path) == [1] and leading_component(path) == 1
    path = mixed({"S11": 0.0, "gamma12": 0.1}, [[0, 0, 1.0]], "strain")
    assert changed_components(path) == [2] and named_components(path) == [0, 2]
    assert changed_components(mixed([[0.1, 0, 0], {"S11": 5.0}, {"S11": 5.0, "E22": 0.1}], [[1, 0, 0]], "stress")) == [
        0,
        1,
    ]


def test_the_strength_of_the_first_leg_is_the_peak_although_later_legs_strain_more() -> None:
    """Tension breaks bonds, then compression with shear breaks more; E22 follows, and is largest on leg 2."""
    rows = [(4.0, 0.0), (5.0, 0.0), (3.0, 0.0), (-3.0, 0.0), (-3.0, 2.0), (-3.0, 1.0)]
    path = mixed([[0.5, 0, 0], {"S11": -3.0}, {"S11": -3.0, "gamma12": 9.0}], [[a, 0, b] for a, b in rows], "strain")
    loads = [0.2, 0.3, 1 / 3, 2 / 3, 0.9, 1.0]
    for entry, load, broke, gamma in zip(
        path["path"], loads, (0, 1, 1, 0, 0, 1), (0, 0, 0, 0, 20.0, 50.0), strict=True
    ):
        entry |= {"load_factor": load, "broke": broke, "strain": [entry["strain"][0], 60.0 * load, gamma]}
    peak = peak_of(path)
    assert (peak["stress_name"], peak["stress"], peak["event"], peak["first_break_event"]) == ("S11", 5.0, 1, 1)
    # On the ray of point 2 at the load of the break; the second leg unloads, and is no fall.
    assert peak["stress_left"] == pytest.approx(3.0 * 0.3 / (1 / 3)) and peak["event_left"] == 2
    assert list(largest_of_legs(path)) == [(1, 0, 1), (2, 0, 3), (3, 2, 4)]
    path["path"][4]["stress"][2] = path["path"][5]["stress"][2] = 0.5  # leg 3 unloads
    path["path"][3]["stress"][2] = 0.75
    assert list(largest_of_legs(path))[2] == (3, 2, 3)
    path["path"][4]["stress"][2], path["path"][5]["stress"][2] = 2.0, 1.0
    for entry in path["path"][:3]:
        entry["broke"] = 0
    assert leading_component(path) == 2 and peak_of(path)["stress"] == 2.0
    # Bonds that soften on the first leg, and break on a later one, give the same peak.
    path["path"][1]["softened"] = 1
    peak = peak_of(path)
    assert leading_component(path) == 0
    assert (peak["stress_name"], peak["stress"], peak["event"], peak["first_softening_stress"]) == ("S11", 5.0, 1, 5.0)


def test_the_strain_that_leads_is_among_those_that_are_named() -> None:
    """Poisson's strain and thermal ones may be larger."""
    path = mixed([{"temperature": -100.0}, {"S13": 1.0}], [[0] * 6, [0, 0, 0, 0, 1.0, 0]])
    path["path"][0]["strain"] = path["path"][1]["strain"] = [-20.0, -20.0, -3.0, 0.0, 7.0, 0.0]
    assert leading_component(path) == 4 and shown_components(path) == ["S13"]
    cooled = mixed({"temperature": -100.0}, [[0] * 6])
    cooled["path"][0]["strain"] = [-1.0, -2.0, -0.5, 0.0, 0.0, 0.0]
    assert leading_component(cooled) == 1 and shown_components(cooled) == ["E11", "E22", "E33"]


@pytest.mark.parametrize(
    ("load", "word"), [({"E11": 0.1, "S22": 0.0}, "strain"), ({"S11": 5.0}, "load"), ({"E11": 0.1, "S22": 5.0}, "load")]
)
def test_what_rises_is_the_strain_if_no_stress_is_given(load: dict[str, float], word: str) -> None:
    assert what_rises(mixed(load, [[1.0, 0, 0]], "strain")) == word
    assert what_rises(mixed({"E22": 0.1, "temperature": 5.0}, [[1.0] * 6])) == "load"


def test_under_a_given_stress_the_strain_jumps_at_a_rising_load() -> None:
    """Rays of rising compliance: at load 0.5 from 1 to 4 times the first, past the one that breaks below it."""
    path = mixed({"S13": 2.0}, [[0, 0, 0, 0, 2 * t, 0] for t in (0.5, 0.4, 0.8, 1.0)])
    for point, load, factor in zip(path["path"], (0.5, 0.4, 0.8, 1.0), (1, 2, 4, 5), strict=True):
        stress = np.array([0, 0, 0, 0, 2 * load, 0])
        point |= {"load_factor": load, "stress": stress.tolist(), "strain": (factor * COMPLIANCE @ stress).tolist()}
    found = rising_strain(path)
    assert found is not None and found.shape == (6, 7)
    expected = [[0, 0], [7, 1], [28, 1], [44.8, 1.6], [56, 1.6], [70, 2]]
    np.testing.assert_allclose(found[:, [6, 4]], expected, atol=1e-12)
