"""The branch of a path that a rising strain follows, and which of its points are chosen."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from feti_homog.mechanics.response import first_drop, first_leg, rising_strain, strain_controlled
from feti_homog.output.text.point_tables import chosen, chosen_states


def point(load: float, stiffness: float, broke: int = 1) -> dict[str, Any]:
    strain = 0.1 * load
    stress = [stiffness * strain, 0.0, 0.0]
    return {"load_factor": load, "strain": [strain, 0.0, 0.0], "stress": stress, "broke": broke}


def test_snap_back_becomes_a_drop() -> None:
    # Rays of falling stiffness; the second and third break below the load of the first.
    points = [point(0.5, 10.0), point(0.3, 8.0), point(0.4, 6.0), point(0.8, 4.0), point(1.0, 2.0, 0)]
    found = strain_controlled(points, 0)[:, [3, 0]]
    expected = [[0, 0], [0.05, 0.5], [0.05, 0.2], [0.08, 0.32], [0.08, 0.16], [0.1, 0.2]]
    np.testing.assert_allclose(found, expected, atol=1e-15)


def document(method: str, waypoints: int, points: list[dict[str, Any]]) -> dict[str, Any]:
    path = {"method": method} | ({"waypoints": [[1.0, 0, 0]] * waypoints} if waypoints > 1 else {})
    return {"case": {"path": path}, "path": points}


def test_the_first_drop_ends_on_the_next_branch_that_holds() -> None:
    points = [point(0.5, 10.0), point(0.3, 8.0), point(0.4, 6.0), point(0.8, 4.0), point(1.0, 2.0, 0)]
    stress, number = first_drop(points)
    assert number == 3 and stress.tolist() == pytest.approx([0.05 * 4.0, 0.0, 0.0])


def test_first_legs() -> None:
    points = [point(load, 1.0) for load in (0.2, 0.5, 0.6, 1.0)]
    assert [first_leg(document("events", n, points)) for n in (1, 2, 3)] == [4, 2, 1]
    assert first_leg(document("increments", 2, points)) == 4


def test_rising_strain_of_increments_is_the_points_from_zero() -> None:
    found = rising_strain(document("increments", 1, [point(0.5, 4.0), point(1.0, 2.0)]))
    np.testing.assert_allclose(found[:, [3, 0]], [[0, 0], [0.05, 0.2], [0.1, 0.2]])
    assert rising_strain(document("events", 2, [point(1.0, 2.0)])) is None


def test_no_break_is_a_straight_line() -> None:
    np.testing.assert_allclose(strain_controlled([point(1.0, 3.0, 0)], 0)[:, [3, 0]], [[0, 0], [0.1, 0.3]])


@pytest.mark.parametrize(("count", "rows"), [(1, 6), (6, 6), (7, 6), (500, 15), (3, 2)])
def test_the_first_and_the_last_state_are_drawn(count: int, rows: int) -> None:
    numbers = chosen([point(0.5, 1.0) for _ in range(count)], rows)
    assert numbers[0] == 0 and numbers[-1] == count - 1 and numbers == sorted(set(numbers))
    assert len(numbers) == min(count, rows)


def test_drawn_states_are_where_bonds_break() -> None:
    points = [point(0.01 * n, 1.0, broke=5 if n in (40, 60, 80) else 0) for n in range(101)]
    assert chosen(points, 5) == [0, 40, 60, 100]


def test_of_points_with_fields_those_are_drawn_that_share_the_broken_bonds_evenly() -> None:
    points = [point(0.5, 1.0) for _ in range(101)]
    kept = [0, 1, 2, 48, 75, 99, 100]
    assert chosen(points, 5, kept) == [0, 2, 48, 75, 100]
    assert chosen(points, 10, kept) == kept
    document = {"path": points, "states": kept}
    assert chosen_states(document, 5, 7) == [0, 2, 3, 4, 6]
    # Of a file that ends early there is what there is.
    assert chosen_states(document, 5, 3) == [0, 1, 2]
    assert chosen_states({"path": points[:3]}, 5, 3) == [0, 1, 2]
