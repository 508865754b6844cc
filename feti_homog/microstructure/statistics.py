"""All that is measured of a pattern of fibres."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from feti_homog.microstructure.fibre_pattern import FibrePattern
from feti_homog.microstructure.nearest_neighbours import NearestNeighbours, nearest_neighbours
from feti_homog.microstructure.pair_functions import PairFunctions, distances, pair_directions, pair_functions
from feti_homog.microstructure.randomness import Envelope, envelope
from feti_homog.microstructure.voronoi_cells import VoronoiCells, voronoi_cells
from feti_homog.typing import Float

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
