"""The branch of a path that a rising strain follows, and which of its points are chosen."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from feti_homog.output.plots.response_curves import strain_controlled
from feti_homog.output.text.point_tables import chosen


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
