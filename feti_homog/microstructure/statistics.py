"""All measures of a pattern of fibres, and envelopes of simulations of random models."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from feti_homog.microstructure.fibre_pattern import FibrePattern
from feti_homog.microstructure.neighbour_match import NearestNeighbours, nearest_neighbours
from feti_homog.microstructure.pair_functions import PairFunctions, distances, pair_directions, pair_functions
from feti_homog.microstructure.voronoi_cells import VoronoiCells, voronoi_cells
from feti_homog.typing import Float


@dataclass(frozen=True)
class Envelope:
    """A function of a pattern beside those of n simulations.

    Attributes:
        low, high: (m,) least and largest values of the simulations: at one place a pattern of the model lies outside
            with the probability 2 / (n + 1).
        mean: (m,) of the simulations.
        p_value: of all places together: share of the n + 1 functions, the pattern's among them, whose largest deviation
            from the mean of all is at least that of the pattern's.
    """

    low: Float
    high: Float
    mean: Float
    p_value: float


def poisson(pattern: FibrePattern, generator: np.random.Generator) -> FibrePattern:
    """Complete spatial randomness: as many centres, each anywhere in the rectangle, whether fibres overlap or not."""
    return replace(pattern, centres=generator.random((pattern.count, 2)) * pattern.size)


def envelope(
    pattern: FibrePattern,
    function: Callable[[FibrePattern], Float],
    simulate: Callable[[FibrePattern, np.random.Generator], FibrePattern],
    count: int,
    seed: int = 0,
) -> Envelope:
    """Return the function (m,) of `count` simulations of a pattern, estimated in each as in the pattern itself.

    The test by the largest deviation is exact: under the model all the functions are exchangeable [Ripley 1977].
    """
    generator = np.random.default_rng(seed)
    every = np.array([function(pattern), *(function(simulate(pattern, generator)) for _ in range(count))])
    simulated = every[1:]
    deviation = np.abs(every - every.mean(axis=0)).max(axis=1)
    p_value = np.count_nonzero(deviation >= deviation[0] * (1 - 1e-12)) / (count + 1)
    return Envelope(simulated.min(axis=0), simulated.max(axis=0), simulated.mean(axis=0), float(p_value))


# Pairs whose directions are measured are at most so many mean nearest distances apart.
NEAR = 1.5


@dataclass(frozen=True)
class FibreStatistics:
    """What `measure` finds.

    Attributes:
        pattern: the fibres.
        neighbours: the three nearest of each.
        pairs: g, K and L.
        random: L beside that of simulations.
        directions: (12,) those of near pairs, see `pair_directions`; 1 where all are alike.
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
    """Return the statistics of at least two fibres, L beside so many simulations by `simulate`."""
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
