"""Kept points of a path: the ends, those around drops of the stress, the rest evenly."""

from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from feti_homog.results.landmarks import drops, kept, passed_strengths, turning_points


def path(stresses: Any, loads: Any = None) -> list[dict[str, Any]]:
    loads = np.linspace(0.0, 1.0, len(stresses) + 1)[1:] if loads is None else loads
    pairs = zip(loads, stresses, strict=True)
    return [{"load_factor": t, "strain": [t, 0.0, 0.0], "stress": [s, 0.3 * s, 0.0]} for t, s in pairs]


def random_walk(seed: int, count: int = 500) -> list[dict[str, Any]]:
    """Rising loads and a stress that goes up and down."""
    rng = np.random.default_rng(seed)
    return path(np.abs(np.cumsum(rng.normal(size=count))), np.sort(rng.uniform(size=count)))


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ([1, 2, 3], [0, 2]),
        ([3, 2, 1], [0, 2]),
        ([1, 3, 2], [0, 1, 2]),
        ([1, 3, 2.95, 3.2, 0, 0.05, 0.02], [0, 3, 4]),
        ([5, 1, 4, 1, 6], [0, 1, 2, 3, 4]),
        ([2, 2.05, 2.01, 1.98], []),
        ([2], []),
    ],
)
def test_a_curve_turns_where_it_has_gone_back_far_enough(values: list[float], expected: list[int]) -> None:
    assert turning_points(np.array(values, float), 0.1) == expected


@pytest.mark.parametrize("seed", range(20))
def test_turning_points_leave_a_curve_as_it_is(seed: int) -> None:
    """Between two of them it never goes back by more than the least swing, and they are its extremes there."""
    values = np.cumsum(np.random.default_rng(seed).normal(size=300))
    numbers, least = turning_points(values, 3.0), 3.0
    for a, b in pairwise(numbers):
        part = values[a : b + 1] * np.sign(values[b] - values[a])
        assert part[-1] - part[0] > least and part.argmax() == b - a and part.argmin() == 0
        assert (np.maximum.accumulate(part) - part).max() <= least


@pytest.mark.parametrize("states", [2, 3, 10, 77, 499, 500, 1000])
@pytest.mark.parametrize("seed", range(5))
def test_as_many_as_asked_for_with_both_ends(seed: int, states: int) -> None:
    numbers = kept(random_walk(seed), states, 1)
    assert len(numbers) == len(set(numbers)) == min(states, 500)
    assert numbers == sorted(numbers) and (numbers[0], numbers[-1]) == (0, 499)


def test_without_drops_states_are_even() -> None:
    assert kept(random_walk(0), "all", 1) == list(range(500))
    assert kept([], 5, 1) == [] and kept(path([1.0]), "peaks", 1) == [0] == kept(path([1.0]), 2, 1)
    assert kept(path(np.linspace(0.1, 1.0, 101)), 11, 1) == list(range(0, 101, 10))
    assert kept(path(np.linspace(0.1, 1.0, 101)), "peaks", 1) == [0, 100]
    rising = np.linspace(0.5, 1.0, 200) + 0.004 * (np.arange(200) % 2)
    assert kept(path(rising), "peaks", 1) == [0, 199]
    assert drops(path(rising), 1) == []


def test_the_deepest_drops_come_first() -> None:
    stress = np.linspace(1.0, 2.0, 101)
    for number, depth in ((20, 0.1), (50, 0.5), (80, 0.3)):
        stress[number:] -= depth
    points = path(stress)
    assert kept(points, "peaks", 0) == [0, 19, 20, 49, 50, 79, 80, 100]
    assert {49, 50, 79, 80} <= set(kept(points, 10, 0)) and {49, 50} <= set(kept(points, 6, 0))
    assert {19, 20, 49, 50, 79, 80} <= set(kept(points, 20, 0))
    gaps = np.diff(kept(points, 20, 0))
    assert gaps.max() <= 10


def test_what_a_rising_load_comes_to_after_a_snap_back_is_kept() -> None:
    """Rays through zero; the stress falls at load 0.5 from 5 to the branch of point 4."""
    stiffness, load = np.array([10.0, 9.0, 8.0, 7.0, 6.0, 5.9]), np.array([0.5, 0.4, 0.35, 0.45, 0.6, 1.0])
    points = path(stiffness * load, load)
    assert (pytest.approx(2.0 * np.hypot(1.0, 0.3)), 0, 4) in drops(points, 1)
    assert kept(points, "peaks", 1) == [0, 2, 4, 5]
    # With increments, and beyond the first leg, what is followed is the load that is controlled.
    assert kept(points, "peaks", 0) == kept(points, "peaks", 3) == [0, 2, 5]


@pytest.mark.parametrize("shear", [0.0, 1.0])
def test_the_size_of_a_stress_is_that_of_the_tensor(shear: float) -> None:
    """Turning the axes by 45 degrees makes a shear of tension and pressure; the drops are the same."""
    stress = [[1.0 - shear, shear - 1.0, shear], [0.5 - 0.5 * shear, 0.5 * shear - 0.5, 0.5 * shear]]
    strain = [1.0, 0.0, 0.0]
    points = [{"load_factor": t, "strain": strain, "stress": s} for t, s in zip((0.5, 1.0), stress, strict=True)]
    assert drops(points, 0) == [(pytest.approx(0.5 * np.sqrt(2.0)), 0, 1)]


def in_space(strain: float, stress: float, load: float) -> dict[str, Any]:
    """Return pulled along x2: [11, 22, 33, 23, 13, 12]."""
    return {
        "load_factor": load,
        "strain": [-0.3 * strain, strain, -0.2 * strain, 0.0, 0.0, 0.0],
        "stress": [0.0, stress, 0.0, 0.0, 0.0, 0.0],
    }


def test_drops_of_six_components_are_those_of_the_tensor() -> None:
    """The shears 23 and 13 count as 12 does: a turn about x1 or x2 does not change what falls."""
    for place in (3, 4, 5):
        points = [in_space(t, 0.0, t) for t in (0.5, 1.0)]
        for point, stress in zip(points, (1.0, 0.25), strict=True):
            point["stress"][place] = stress
        assert drops(points, 0) == [(pytest.approx(0.75 * np.sqrt(2.0)), 0, 1)]


def test_under_a_given_stress_the_jump_of_the_strain_is_a_drop() -> None:
    """On the first leg rays of rising compliance: at load 0.5 from point 0 to the branch of point 2."""
    load, compliance = (0.5, 0.4, 0.8, 1.0), (1.0, 1.5, 2.0, 2.0)
    points = [in_space(c * t, t, t) for t, c in zip(load, compliance, strict=True)]
    assert kept(points, "peaks", 1) == [0, 1, 2, 3]
    # The largest strain is 2, the largest stress 1: the jump by 0.5 is a quarter of both.
    assert (pytest.approx(0.25), 0, 2) in drops(points, 1)


def test_on_later_legs_bonds_that_break_at_one_load_make_a_jump() -> None:
    load = [0.5, 0.6, 0.7, 0.7, 0.7, 0.9, 1.0]
    points = [in_space(e, t, t) for t, e in zip(load, (0.5, 0.6, 0.7, 0.9, 1.2, 1.6, 1.8), strict=True)]
    assert kept(points, "peaks", 2) == [0, 2, 5, 6]
    # Of saw teeth, one break at a load, there is none.
    assert kept(points[:3] + points[5:], "peaks", 2) == [0, 4]


@pytest.mark.parametrize(
    ("utilisation", "place"),
    [
        ([2.0, 2.5, 9.0, 9.0], "at about S11 = 5, E11 = 0.125, before the peak"),  # on the way to point 0
        ([0.5, 1.5, 9.0, 9.0], "at about S11 = 15, E11 = 0.375, before"),  # half way between two points
        ([0.2, 0.9, 1.1, 9.0], None),  # beyond the peak
        ([0.2, 0.3, 0.3, 0.9], None),
        (None, None),
    ],
)
def test_a_phase_passes_its_strength_between_points(utilisation: Any, place: str | None) -> None:
    peak = {"strain_name": "E11", "stress_name": "S11", "event": 1, "stress": 20.0}
    phase = {"phase": "epoxy"} | ({} if utilisation is None else {"utilisation": utilisation})
    case = {"path": {"method": "events", "to": {"E11": 1.0}}}
    document = {"case": case, "path": path([10.0, 20.0, 20.0, 15.0]), "phase_stresses": [phase]}
    lines = passed_strengths(document, peak, range(4))
    assert len(lines) == (place is not None)
    assert place is None or lines[0].startswith(f"[material.epoxy] strength: the utilisation reaches 1 {place}")


def test_on_a_later_leg_a_phase_passes_its_strength_in_an_interval() -> None:
    """Behind a cooled leg the utilisation is no linear function of the load."""
    peak = {"strain_name": "E11", "stress_name": "S11", "event": 0, "stress": 40.0}
    phase = {"phase": "epoxy", "utilisation": [0.4, 0.6, 0.7, 1.2]}
    case = {"path": {"method": "events", "waypoints": [{"S11": 40.0}, {"S11": 30.0}]}}
    document = {"case": case, "path": path([20.0, 40.0, 39.0, 38.5]), "phase_stresses": [phase]}
    (line,) = passed_strengths(document, peak, range(4))
    assert "reaches 1 between S11 = 39 and 38.5, E11 = 0.75 and 1; the path takes" in line
