"""Fibres moved until the distances of their nearest neighbours are distributed as those of a measured pattern."""

from __future__ import annotations

from math import sqrt

import numpy as np

from feti_homog.microstructure.fibre_pattern import FibrePattern
from feti_homog.microstructure.nearest_neighbours import nearest_neighbours
from feti_homog.typing import Float, Int

# Nearest and second nearest.
SHELLS = 2
# Moves that are tried: for each fibre, and in all.
MOVES_OF_A_FIBRE, MOST_MOVES = 100, 40_000
# A distance of distributions, in mean diameters, at which no more moves are tried.
CLOSE = 0.002


def knows_neighbours(measured: FibrePattern) -> bool:
    """Return whether a pattern has distances of nearest and of second neighbours that count."""
    return bool(nearest_neighbours(measured, SHELLS).weights.any(axis=0).all())


def wanted_distances(measured: FibrePattern, count: int) -> Float:
    """(count, SHELLS) quantiles at the levels (i + 1/2) / count of the nearest and the second distances of a pattern.

    In its mean diameters.  Raises ValueError if a window is too small to know them.
    """
    near, levels = nearest_neighbours(measured, SHELLS), (np.arange(count) + 0.5) / count
    return np.stack([near.quantiles(levels, k) for k in range(SHELLS)], axis=1) / (2 * measured.mean_radius)


def match_distance(pattern: FibrePattern, wanted: Float) -> float:
    """Root mean square difference between the sorted distances of a periodic pattern and `wanted` (N, SHELLS).

    Both are in mean diameters.  It is the quadratic Wasserstein distance of the distributions, over both neighbours.
    """
    own = nearest_neighbours(pattern, SHELLS).distances / (2 * pattern.mean_radius)
    return sqrt(_mean_square(own, wanted))


def matched(pattern: FibrePattern, gap: float, wanted: Float, generator: np.random.Generator) -> Float:
    """Centres (N, 2) of the fibres of a periodic pattern, moved such that `match_distance` to `wanted` falls.

    One fibre after the other, drawn at random, is moved to a place drawn about its own, near or far, if it keeps `gap`
    to all others there and the distance of the distributions does not grow.  Sums are made one term after the other, so
    that every machine takes the same moves.  N is at least 3.
    """
    count, size = pattern.count, pattern.size
    centres, target = pattern.wrapped.copy(), wanted * (2 * pattern.mean_radius)
    everyone = np.arange(count)
    near, who = _two_nearest(centres, everyone, size)
    error, goal = _mean_square(near, target), (CLOSE * 2 * pattern.mean_radius) ** 2
    reach = sqrt(pattern.area / count)
    for _ in range(min(MOVES_OF_A_FIBRE * count, MOST_MOVES)):
        if error < goal:
            break
        fibre, scale = int(generator.integers(count)), float(generator.random())
        step = (2 * generator.random(2) - 1) * (reach * scale * scale)
        place = (centres[fibre] + step) % size
        away = _distances(place[None], centres, size)[0]
        away[fibre] = np.inf
        if np.any(away < pattern.radii + (pattern.radii[fibre] + gap)):
            continue
        changed = np.flatnonzero((away < near[:, 1]) | np.any(who == fibre, axis=1) | (everyone == fibre))
        before, centres[fibre] = centres[fibre].copy(), place
        new_near, new_who = near.copy(), who.copy()
        new_near[changed], new_who[changed] = _two_nearest(centres, changed, size)
        new_error = _mean_square(new_near, target)
        if new_error <= error:
            near, who, error = new_near, new_who, new_error
        else:
            centres[fibre] = before
    return centres


def _distances(places: Float, centres: Float, size: Float) -> Float:
    """(m, N) from places (m, 2) to the nearest images of centres (N, 2)."""
    x, y = (np.abs(places[:, None, axis] - centres[:, axis]) for axis in (0, 1))
    x, y = np.minimum(x, size[0] - x), np.minimum(y, size[1] - y)
    return np.asarray(np.sqrt(x * x + y * y))


def _two_nearest(centres: Float, fibres: Int, size: Float) -> tuple[Float, Int]:
    """Distances (m, 2) from these fibres (m,) to the two nearest others, and which these are."""
    away = _distances(centres[fibres], centres, size)
    rows = np.arange(len(fibres))
    away[rows, fibres] = np.inf
    first = away.argmin(axis=1)
    nearest = away[rows, first]
    away[rows, first] = np.inf
    second = away.argmin(axis=1)
    return np.stack([nearest, away[rows, second]], axis=1), np.stack([first, second], axis=1)


def _mean_square(distances: Float, wanted: Float) -> float:
    """Mean square difference of distances (N, SHELLS), each column sorted, from those wanted."""
    difference = np.sort(distances, axis=0) - wanted
    return float(np.cumsum(difference * difference)[-1]) / wanted.size
