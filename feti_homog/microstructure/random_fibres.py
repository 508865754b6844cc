"""Place random discs without overlap, and move discs until neighbour distances match a measured pattern."""

from dataclasses import dataclass, replace
from functools import cached_property
from math import sqrt

import numpy as np
from scipy.spatial import cKDTree

from feti_homog.errors import MeshError
from feti_homog.microstructure.arrangements import neighbours
from feti_homog.microstructure.fibre_pattern import FibrePattern
from feti_homog.typing import Float, Int

# Number of neighbours with matched distances: the nearest and the second nearest.
SHELLS = 2
# Limits of the trial moves: per fibre, and in total.
MOVES_OF_A_FIBRE, MOST_MOVES = 100, 40_000
# Distance of distributions, in mean diameters, at which the search stops.
CLOSE = 0.002
# Relative enlargement of the radii, so that the descent ends in finite time.
RADIUS_EXCESS = 1e-3
# Steps of the descent after which an arrangement counts as jammed; others take fewer than 200.
MAX_STEPS = 2000
ATTEMPTS = 3
# Area fraction of discs grown by half the gap above which there are no random patterns.
DENSEST = 0.9


@dataclass(frozen=True)
class NearestNeighbours:
    """The k nearest neighbours of N fibres, by the distance between centres.

    Attributes:
        distances: (N, k), in ascending order; infinite if a window has too few fibres.
        directions: (N, k) degrees from x1 towards x2, in [0, 360); NaN at infinite distances.
        weights: (N, k), weights of the distances in their distribution; each column sums to 1.  In a periodic cell
            weights are 1/N.  In a window a distance d counts if the circle of radius d around the fibre lies inside, so
            that no fibre outside can be closer.  The weight 1 / ((width - 2 d) (height - 2 d)) [Hanisch 1984]
            compensates for the loss of long distances.  A column is zero if none of its distances counts.
    """

    distances: Float
    directions: Float
    weights: Float

    @cached_property
    def means(self) -> Float:
        """The weighted mean distances (k,), NaN for columns without a counted distance."""
        total = (self.weights * np.where(self.weights > 0, self.distances, 0.0)).sum(axis=0)
        return np.where(self.weights.any(axis=0), total, np.nan)

    @cached_property
    def deviations(self) -> Float:
        """The weighted standard deviations (k,) of distances, NaN for columns without a counted distance."""
        counted = np.where(self.weights > 0, self.distances - self.means, 0.0)
        return np.where(self.weights.any(axis=0), np.sqrt((self.weights * counted**2).sum(axis=0)), np.nan)

    def quantiles(self, levels: Float, column: int) -> Float:
        """Return the quantiles of the distances in one column.

        The quantiles (m,) are the least distances d with F(d) >= levels (m,) for the weighted distribution F. Raises
        ValueError if no distance of the column counts.
        """
        order = np.argsort(self.distances[:, column], kind="stable")
        order = order[self.weights[order, column] > 0]
        if not len(order):
            raise ValueError("no distance counts")
        share = np.cumsum(self.weights[order, column])
        place = np.searchsorted(share / share[-1], levels - 1e-12)
        return np.asarray(self.distances[order[place], column])


def nearest_neighbours(pattern: FibrePattern, count: int = 3) -> NearestNeighbours:
    """Find the `count` nearest neighbours of all fibres; in a periodic cell, neighbours may be images of fibres."""
    # Within `reach` every fibre in a periodic cell has `count` neighbours.
    reach = (count + 1) // 2 * pattern.size.min()
    if pattern.periodic and pattern.count > count:
        away, _ = cKDTree(pattern.wrapped, boxsize=pattern.size).query(pattern.wrapped, count + 1)
        reach = min(reach, away.max()) * (1 + 1e-9)
    candidates, _ = pattern.images(float(reach))
    columns = min(count, len(candidates) - 1)
    distances, directions = np.full((pattern.count, count), np.inf), np.full((pattern.count, count), np.nan)
    if columns:
        result, which = cKDTree(candidates).query(candidates[: pattern.count], columns + 1)
        distances[:, :columns] = result[:, 1:]  # the first is the fibre itself
        vectors = candidates[which[:, 1:]] - candidates[: pattern.count, None]
        directions[:, :columns] = np.degrees(np.arctan2(vectors[..., 1], vectors[..., 0])) % 360
    if pattern.periodic:
        return NearestNeighbours(distances, directions, np.full(distances.shape, 1 / pattern.count))
    to_side = np.minimum(pattern.centres, pattern.size - pattern.centres).min(axis=1)
    counts = distances <= to_side[:, None]
    d = np.where(counts, distances, 0.0)
    inner = (pattern.width - 2 * d) * (pattern.height - 2 * d)
    raw = np.where(counts & (inner > 0), 1 / np.where(inner > 0, inner, 1.0), 0.0)
    total = raw.sum(axis=0)
    return NearestNeighbours(distances, directions, raw / np.where(total > 0, total, 1.0))


def wanted_distances(measured: FibrePattern, count: int) -> Float:
    """Return the quantiles (count, SHELLS) of the distances to the nearest neighbours in the pattern `measured`.

    The levels are (i + 1/2) / count; the unit is the mean diameter. Raises ValueError if a window is too small.
    """
    near, levels = nearest_neighbours(measured, SHELLS), (np.arange(count) + 0.5) / count
    return np.stack([near.quantiles(levels, k) for k in range(SHELLS)], axis=1) / (2 * measured.mean_radius)


def match_distance(pattern: FibrePattern, wanted: Float) -> float:
    """Compare neighbour distances in a periodic pattern with the target `wanted` (N, SHELLS), in mean diameters.

    Returns the root mean square difference between the sorted distances of the nearest and second neighbours, in mean
    diameters. This is the quadratic Wasserstein distance of the distributions.
    """
    near = nearest_neighbours(pattern, SHELLS).distances / (2 * pattern.mean_radius)
    return sqrt(_mean_square(near, wanted))


def matched(pattern: FibrePattern, gap: float, wanted: Float, generator: np.random.Generator) -> Float:
    """Move the fibres of a periodic pattern to reduce the `match_distance` from the target `wanted`.

    A trial move takes a random fibre to a random position around its centre, near or far. The move is accepted if the
    fibre keeps `gap` to all other fibres and the distance between the distributions does not increase. The search ends
    when this distance is below CLOSE, or after MOVES_OF_A_FIBRE moves per fibre, at most MOST_MOVES. Sums have a fixed
    order of terms, so that every machine takes the same moves. Returns the centres (N, 2), N at least 3.
    """
    count, size = pattern.count, pattern.size
    centres, target = pattern.wrapped.copy(), wanted * (2 * pattern.mean_radius)
    numbers = np.arange(count)
    near, who = _two_nearest(centres, numbers, size)
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
        changed = np.flatnonzero((away < near[:, 1]) | np.any(who == fibre, axis=1) | (numbers == fibre))
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
    """Return the distances (m, N) from `places` (m, 2) to the nearest images of `centres` (N, 2)."""
    x, y = (np.abs(places[:, None, axis] - centres[:, axis]) for axis in (0, 1))
    x, y = np.minimum(x, size[0] - x), np.minimum(y, size[1] - y)
    return np.asarray(np.sqrt(x * x + y * y))


def _two_nearest(centres: Float, fibres: Int, size: Float) -> tuple[Float, Int]:
    """Find the two nearest neighbours of `fibres` (m,) on the torus.  Returns distances and indices (m, 2)."""
    away = _distances(centres[fibres], centres, size)
    rows = np.arange(len(fibres))
    away[rows, fibres] = np.inf
    first = away.argmin(axis=1)
    nearest = away[rows, first]
    away[rows, first] = np.inf
    second = away.argmin(axis=1)
    return np.stack([nearest, away[rows, second]], axis=1), np.stack([first, second], axis=1)


def _mean_square(distances: Float, wanted: Float) -> float:
    """Return the mean square difference between `distances` (N, SHELLS), sorted by column, and the sorted `wanted`."""
    difference = np.sort(distances, axis=0) - wanted
    return float(np.cumsum(difference * difference)[-1]) / wanted.size


def relax(centres: Float, radii: Float, max_steps: int, size: tuple[float, float] = (1.0, 1.0)) -> tuple[Float, float]:
    """Move centres (N, 2) until discs do not overlap on the torus with periods `size`.

    Returns the centres and the clearance: the smallest ratio of the distance between two centres to the sum of their
    radii, at most 2. Without success in `max_steps` steps, the clearance is below 1 and belongs to the centres before
    the last step. The heavy-ball descent x += 0.25 f + 0.9 dx, with the previous step dx and the push f of overlaps,
    has no reductions over the discs, so that every machine gets the same numbers.
    """
    periods, target = np.array(size), radii * (1 + RADIUS_EXCESS)
    step, clearance = np.zeros_like(centres), 0.0
    for _ in range(max_steps):
        first, second, vector = neighbours(centres, periods, 2 * target.max())
        distance = np.sqrt(vector[:, 0] * vector[:, 0] + vector[:, 1] * vector[:, 1])
        clearance = float(np.min(distance / (radii[first] + radii[second]), initial=2.0))
        if clearance >= 1:
            break
        overlap = np.maximum(target[first] + target[second] - distance, 0.0)
        push = (overlap / np.maximum(distance, 1e-9))[:, None] * vector
        forces = [np.bincount(second, x, len(radii)) - np.bincount(first, x, len(radii)) for x in push.T]
        step = 0.25 * np.stack(forces, axis=1) + 0.9 * step
        centres = (centres + step) % periods
    return centres, clearance


def placed(
    pattern: FibrePattern, gap: float, generator: np.random.Generator, max_steps: int = MAX_STEPS
) -> FibrePattern:
    """Place the fibres of a pattern at random, with gaps of at least `gap`; return the new pattern.

    Raises MeshError for discs denser than DENSEST, or if ATTEMPTS descents of up to `max_steps` steps fail.
    """
    grown = pattern.radii + gap / 2
    attempts = ATTEMPTS if np.pi * np.sum(grown**2) < DENSEST * pattern.area else 0
    for _ in range(attempts):
        places = generator.random((pattern.count, 2)) * pattern.size
        centres, clearance = relax(places, grown, max_steps, (pattern.width, pattern.height))
        if clearance >= 1:
            return replace(pattern, centres=centres)
    words = f"with the fibre fraction {pattern.fibre_fraction:.4g} and the smallest gap {gap:.4g}"
    raise MeshError(f"no random pattern {words} is found")
