"""Measures of a pattern of fibres: g(r), Ripley's K(r), L(r), Voronoi cells; envelopes of simulated random models."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import product
from math import pi, sqrt

import numpy as np
from scipy.spatial import Voronoi, cKDTree

from feti_homog.errors import MeshError
from feti_homog.microstructure.fibre_pattern import FibrePattern
from feti_homog.microstructure.random_fibres import MAX_STEPS, NearestNeighbours, nearest_neighbours, placed
from feti_homog.typing import Bool, Float

# The longest distance of pair functions, in mean spacings 1 / sqrt(fibres per area): beyond, g is 1 in random cells.
FAR = 10.0
# Steps of the distance, in mean radii.
STEP = 0.2
SECTORS = 12
# Pairs whose directions are measured are at most so many mean nearest distances apart.
NEAR = 1.5
# Centres on a side of a window are moved in by this share of the shorter side: they would coincide with their images.
OFF_SIDE = 1e-9


@dataclass(frozen=True)
class PairFunctions:
    """Functions of the distance between centres.

    Attributes:
        r: (m,) distances in equal steps; the first distance is one step.
        ripley_k: (m,) K(r), mean number of other fibres within r of a fibre / number of fibres per area.
        radial: (m,) radial distribution function g in the step that ends at r: growth of K / area of the ring.
    """

    r: Float
    ripley_k: Float
    radial: Float

    @property
    def ripley_l(self) -> Float:
        """The function L(r) = sqrt(K / pi) (m,), which is r for complete spatial randomness."""
        return np.asarray(np.sqrt(self.ripley_k / pi))


def distances(pattern: FibrePattern) -> Float:
    """Return distances (m,) of the pair functions: up to half of the shorter side and at most `FAR` mean spacings."""
    reach = min(float(pattern.size.min()) / 2, FAR * sqrt(pattern.area / pattern.count))
    steps = max(10, round(reach / (STEP * pattern.mean_radius)))
    return np.asarray(reach * np.arange(1, steps + 1) / steps)


def smallest_gap(pattern: FibrePattern) -> float:
    """Return the smallest gap between two fibres, periodic images included; infinite for a single fibre."""
    if not pattern.periodic and pattern.count == 1:
        return np.inf
    tree = cKDTree(pattern.images(float(pattern.size.min()))[0])
    nearest = tree.query(tree.data[: pattern.count], 2)[0][:, 1].min()
    points, owner = pattern.images(reach := float(nearest + 2 * np.ptp(pattern.radii)) * (1 + 1e-9))
    pairs = cKDTree(points).query_pairs(reach, output_type="ndarray")
    pairs = pairs[pairs[:, 0] < pattern.count]
    distance = np.hypot(*(points[pairs[:, 1]] - points[pairs[:, 0]]).T)
    return float((distance - pattern.radii[owner[pairs]].sum(axis=1)).min())


def pair_vectors(pattern: FibrePattern, reach: float) -> Float:
    """Return vectors (k, 2) from each centre to all centres and images, also its own images, at most `reach` away."""
    points, _ = pattern.images(reach * (1 + 1e-9))
    own = points[: pattern.count]
    near = cKDTree(own).sparse_distance_matrix(cKDTree(points), reach, output_type="ndarray")
    near = near[near["i"] != near["j"]]
    return np.asarray(points[near["j"]] - own[near["i"]])


def pair_functions(pattern: FibrePattern, r: Float) -> PairFunctions:
    """Return K(r) = A / (N (N - 1)) sum_{i != j} w_ij [|x_i - x_j| <= r] at distances r (m,), and g = K' / (2 pi r).

    In a periodic cell w = 1, and r is at most half of the shorter side, so that each pair has one image; in a window
    w_ij = A / ((width - |dx|) (height - |dy|)), the translation correction [Ohser & Stoyan 1981], which keeps K and g
    unbiased.  Needs two fibres.
    """
    vectors = pair_vectors(pattern, float(r[-1]))
    place = np.searchsorted(r, np.hypot(*vectors.T))  # of the least r that is not below the distance
    place = np.minimum(place, len(r) - 1)  # of a distance that rounding put beyond the last
    shares = np.bincount(place, _translation_weights(pattern, vectors), len(r))
    growth = shares * (pattern.area / (pattern.count * (pattern.count - 1)))
    rings = pi * np.diff(r * r, prepend=0.0)
    return PairFunctions(r, np.cumsum(growth), growth / rings)


def pair_directions(pattern: FibrePattern, reach: float) -> Float:
    """Return (SECTORS,) share of pairs at most `reach` apart in each sector of directions / share if all were alike.

    Sectors have 180 / SECTORS degrees, the first about x1, the others in order towards x2; a pair has no front and
    back.  Pairs of a window have the weights of `pair_functions`.  All shares are 0 if no two fibres are that near.
    """
    vectors = pair_vectors(pattern, reach)
    angle = np.degrees(np.arctan2(vectors[:, 1], vectors[:, 0]))
    sector = np.floor(angle * SECTORS / 180 + 0.5).astype(int) % SECTORS
    shares = np.bincount(sector, _translation_weights(pattern, vectors), SECTORS)
    return np.asarray(SECTORS * shares / (shares.sum() or 1.0))


def _translation_weights(pattern: FibrePattern, vectors: Float) -> Float:
    """Return weights (k,): 1 / the share of the window's places at which a pair with this vector fits in."""
    if pattern.periodic:
        return np.ones(len(vectors))
    return np.asarray(pattern.area / np.prod(pattern.size - np.abs(vectors), axis=1))


@dataclass(frozen=True)
class Envelope:
    """A function of a pattern beside the functions of n simulations.

    Attributes:
        low, high: (m,) least and largest values of the simulations; at one place a pattern of the model lies outside
            with the probability 2 / (n + 1).
        mean: (m,) mean of the simulations.
        p_value: for all places together, the share of the n + 1 functions, with the pattern's own, that deviate from
            the mean of all at least as far as the pattern's.
    """

    low: Float
    high: Float
    mean: Float
    p_value: float


def hard_core(pattern: FibrePattern, generator: np.random.Generator, max_steps: int = MAX_STEPS) -> FibrePattern:
    """Place the fibres of a pattern at random, as in random cells (`relax`).

    No gap is smaller than the smallest gap of the pattern.  A window is treated as a periodic cell.

    Raises:
        MeshError: no such pattern is found.
    """
    try:
        return placed(pattern, max(smallest_gap(pattern), 0.0), generator, max_steps)
    except MeshError as error:
        raise MeshError(f"{error}; compare with --model poisson") from error


def poisson(pattern: FibrePattern, generator: np.random.Generator) -> FibrePattern:
    """Return complete spatial randomness: as many centres anywhere in the rectangle, whether fibres overlap or not."""
    return replace(pattern, centres=generator.random((pattern.count, 2)) * pattern.size)


def envelope(
    pattern: FibrePattern,
    function: Callable[[FibrePattern], Float],
    simulate: Callable[[FibrePattern, np.random.Generator], FibrePattern],
    count: int,
    seed: int = 0,
) -> Envelope:
    """Compare a summary function of a pattern with `count` simulations.

    `function` returns (m,) for a pattern.  The test by the largest deviation is exact: under the model all the
    functions are exchangeable [Ripley 1977].
    """
    generator = np.random.default_rng(seed)
    every = np.array([function(pattern), *(function(simulate(pattern, generator)) for _ in range(count))])
    simulated = every[1:]
    deviation = np.abs(every - every.mean(axis=0)).max(axis=1)
    p_value = np.count_nonzero(deviation >= deviation[0] * (1 - 1e-12)) / (count + 1)
    return Envelope(simulated.min(axis=0), simulated.max(axis=0), simulated.mean(axis=0), float(p_value))


@dataclass(frozen=True)
class FibreStatistics:
    """Results of `measure`.

    Attributes:
        pattern: the fibres.
        neighbours: the three nearest fibres of each fibre.
        pairs: g, K and L.
        random: L beside the L of simulations.
        directions: (12,) `pair_directions` of near pairs; 1 if all are alike.
        cells: the Voronoi cells.
    """

    pattern: FibrePattern
    neighbours: NearestNeighbours
    pairs: PairFunctions
    random: Envelope
    directions: Float
    cells: VoronoiCells


def measure(
    pattern: FibrePattern,
    simulate: Callable[[FibrePattern, np.random.Generator], FibrePattern],
    simulations: int,
    seed: int = 0,
) -> FibreStatistics:
    """Return the statistics of at least two fibres, with L beside simulations by `simulate`."""
    neighbours, r = nearest_neighbours(pattern), distances(pattern)
    nearest = neighbours.distances[:, 0]
    return FibreStatistics(
        pattern=pattern,
        neighbours=neighbours,
        pairs=pair_functions(pattern, r),
        random=envelope(pattern, lambda other: pair_functions(other, r).ripley_l, simulate, simulations, seed),
        directions=pair_directions(pattern, NEAR * float(nearest.mean())),
        cells=voronoi_cells(pattern),
    )


@dataclass(frozen=True)
class VoronoiCells:
    """The Voronoi cells of N fibres.

    Attributes:
        areas: (N,) with the sum width x height.
        fractions: (N,) local fibre fractions pi R^2 / area; their mean, weighted with the areas, is the fibre fraction.
            Voronoi cells ignore radii: where unequal fibres are close, the larger fibre's fraction may exceed 1.
        weights: (N,) weights of the cells in a distribution, with the sum 1: 1/N in a periodic cell.  In a window a
            cell counts if larger surroundings would not change it, with the weight 1 / (share of the window's places
            where the cell and all that determines it would fit in), because fewer large cells fit in.
    """

    areas: Float
    fractions: Float
    weights: Float

    @property
    def whole(self) -> Bool:
        """Whether each cell counts (N,); in a window some do not."""
        return np.asarray(self.weights > 0)

    @property
    def mean_fraction(self) -> float:
        """The weighted mean of the local fractions, NaN if no cell counts."""
        return float(self.weights @ self.fractions) if self.weights.any() else np.nan

    @property
    def fraction_deviation(self) -> float:
        """The weighted standard deviation of the local fractions."""
        return float(np.sqrt(self.weights @ (self.fractions - self.mean_fraction) ** 2))


def voronoi_cells(pattern: FibrePattern) -> VoronoiCells:
    """Return the cells, by images around a periodic pattern, by mirror images at the sides of a window.

    A cell in a window counts if the circles about its corners, through its centre, lie within the window: no fibre
    outside could change it.
    """
    points = _periodic(pattern) if pattern.periodic else _mirrored(pattern)
    diagram = Voronoi(points)
    ends = np.array(diagram.ridge_vertices)
    finite = np.all(ends >= 0, axis=1)
    edges = diagram.vertices[ends[finite]]
    length = np.hypot(*(edges[:, 1] - edges[:, 0]).T)
    areas = np.zeros(pattern.count)
    lowest, highest = np.full((pattern.count, 2), np.inf), np.full((pattern.count, 2), -np.inf)
    for owner, other in (diagram.ridge_points[finite].T, diagram.ridge_points[finite].T[::-1]):
        own = owner < pattern.count
        height = np.hypot(*(points[other[own]] - points[owner[own]]).T) / 2
        areas += np.bincount(owner[own], length[own] * height / 2, pattern.count)
        radius = np.linalg.norm(edges[own] - points[owner[own], None], axis=2)[..., None]
        np.minimum.at(lowest, owner[own], (edges[own] - radius).min(axis=1))
        np.maximum.at(highest, owner[own], (edges[own] + radius).max(axis=1))
    return VoronoiCells(areas, pi * pattern.radii**2 / areas, _weights(pattern, lowest, highest))


def _weights(pattern: FibrePattern, lowest: Float, highest: Float) -> Float:
    """Return the weights of cells whose circles lie between the corners `lowest` and `highest` (N, 2)."""
    if pattern.periodic:
        return np.full(pattern.count, 1 / pattern.count)
    within = np.all((lowest >= 0) & (highest <= pattern.size), axis=1)
    room = np.prod(pattern.size - (highest - lowest), axis=1)
    raw = np.where(within & (room > 0), 1 / np.where(room > 0, room, 1.0), 0.0)
    return np.asarray(raw / (raw.sum() or 1.0))


def _periodic(pattern: FibrePattern) -> Float:
    """Return the centres and their eight images; no other images bound a cell."""
    shifts = [np.array(step) * pattern.size for step in product((-1, 0, 1), repeat=2) if any(step)]
    return np.concatenate([pattern.wrapped, *(pattern.wrapped + shift for shift in shifts)])


def _mirrored(pattern: FibrePattern) -> Float:
    """Return the centres and their mirror images over the four sides."""
    margin = OFF_SIDE * pattern.size.min()
    inside = np.clip(pattern.centres, margin, pattern.size - margin)
    points = [inside]
    for axis, side in product((0, 1), repeat=2):
        image = inside.copy()
        image[:, axis] = 2 * side * pattern.size[axis] - image[:, axis]
        points.append(image)
    return np.concatenate(points)
