"""Edge lengths that grow from sources."""

import numpy as np
import pytest

from feti_homog.mesh.sizes.graded_size import MAX_GROWTH, SizeField

SIZE = np.array([1.0, 0.8])
LARGEST = 0.04


def sources(count, seed=1):
    """Return some of any length and growth, near enough to each other that several matter everywhere."""
    rng = np.random.default_rng(seed)
    return rng.random((count, 2)) * SIZE, 0.05 * rng.random(count), MAX_GROWTH * rng.random(count)


def brute_force(some, points):
    """Return the formula, with every source within its reach."""
    places, lengths, growths = some
    way = points[:, None] - places
    away = np.sqrt(((way - SIZE * np.round(way / SIZE)) ** 2).sum(axis=2))
    sizes = np.where(away < LARGEST / MAX_GROWTH, lengths + growths * away, LARGEST)
    return np.minimum(LARGEST, sizes.min(axis=1))


@pytest.mark.parametrize("count", [1, 20, 150])
def test_sizes_are_those_of_the_formula(count):
    """In several parts."""
    some = sources(count)
    points = 2 * np.random.default_rng(2).random((500, 2)) - 0.5
    expected = brute_force(some, points)
    assert expected.min() < 0.9 * LARGEST or count == 1
    np.testing.assert_allclose(SizeField([some], SIZE, LARGEST, chunk=200)(points), expected, rtol=1e-13)
