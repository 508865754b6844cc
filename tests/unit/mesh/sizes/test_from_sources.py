"""Edge lengths from sources: along lines as at each of their points."""

from __future__ import annotations

import numpy as np
import pytest

from feti_homog.mesh.sizes.from_sources import MAX_GROWTH, SourcedSize

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


def lines(length, points=9):
    """Points of lines in all directions, some across the sides."""
    rng = np.random.default_rng(2)
    begin, angle = rng.random((60, 1, 2)) * SIZE, rng.random((60, 1)) * 2 * np.pi
    share = np.linspace(0, length, points)
    return begin + np.stack([share * np.cos(angle), share * np.sin(angle)], axis=2)


@pytest.mark.parametrize("length", [0.01, 0.1, 0.5])
@pytest.mark.parametrize("count", [1, 20, 150])
def test_lines_are_as_their_points(length, count):
    """Short and long ones, in several parts."""
    some, along = sources(count), lines(length)
    size = SourcedSize([some], SIZE, LARGEST, chunk=200)
    expected = brute_force(some, along.reshape(-1, 2))
    assert expected.min() < 0.9 * LARGEST or count == 1
    np.testing.assert_allclose(size(along.reshape(-1, 2)), expected, rtol=1e-13)
    np.testing.assert_allclose(size.on_lines(along).ravel(), expected, rtol=1e-13)


def test_many_sources_beside_a_line():
    """More than are looked for at once: then as for each point."""
    some, along = sources(4000), lines(0.05)
    size = SourcedSize([some], SIZE, LARGEST)
    np.testing.assert_array_equal(size.on_lines(along).ravel(), size(along.reshape(-1, 2)))


def test_a_line_does_not_see_the_others():
    """To the last bit; a long one among them has another way to look for its sources."""
    size = SourcedSize([sources(600)], SIZE, LARGEST)
    along = np.concatenate([lines(0.02), lines(0.09), lines(0.5)])
    alone = np.concatenate([size.on_lines(line[None]) for line in along])
    np.testing.assert_array_equal(size.on_lines(along), alone)


def test_no_lines():
    assert SourcedSize([sources(3)], SIZE, LARGEST).on_lines(np.zeros((0, 5, 2))).shape == (0, 5)
