"""Pairs of places on opposite sides of a periodic cell."""

import numpy as np

from feti_homog.mesh.coarse_mesh import paired_sides

PERIOD = np.array([2.0, 3.0])


def random_sides(rng, count):
    """Points inside and on the sides of the cell, corners among them, in any order; the same on opposite sides."""
    low_x, low_y = np.r_[0.0, np.sort(rng.random(count)), 1.0] * 3.0, rng.random(count) * 2.0
    points = np.concatenate(
        [
            rng.random((count, 2)) * PERIOD,
            np.column_stack([np.zeros_like(low_x), low_x]),
            np.column_stack([np.full_like(low_x, 2.0), low_x]),
            np.column_stack([low_y, np.zeros_like(low_y)]),
            np.column_stack([low_y, np.full_like(low_y, 3.0)]),
        ]
    )
    return points[rng.permutation(len(points))]


def test_partners_differ_by_a_period():
    rng = np.random.default_rng(0)
    for count in (0, 1, 7, 40):
        points = random_sides(rng, count)
        for axis, low, high in paired_sides(points, PERIOD):
            assert len(low) == count + 2
            np.testing.assert_array_equal(points[high] - points[low], np.tile(np.eye(2)[axis] * PERIOD, (count + 2, 1)))
            assert (np.diff(points[low, 1 - axis]) > 0).all()


def test_every_point_of_a_side_has_a_partner():
    points = random_sides(np.random.default_rng(1), 20)
    for axis, low, high in paired_sides(points, PERIOD):
        assert set(low) == set(np.flatnonzero(points[:, axis] == 0))
        assert set(high) == set(np.flatnonzero(points[:, axis] == PERIOD[axis]))
