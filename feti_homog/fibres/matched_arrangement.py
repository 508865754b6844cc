"""Random cells whose nearest neighbours are as far away as those of fibres that were measured."""

from __future__ import annotations

from math import fsum, pi, sqrt
from typing import TYPE_CHECKING

import numpy as np

from feti_homog.case.phase_names import FIBRE
from feti_homog.errors import MeshError
from feti_homog.fibres.arrangement import Arrangement, clear_shift
from feti_homog.fibres.hard_core import placed
from feti_homog.microstructure.fibre_pattern import FibrePattern
from feti_homog.microstructure.neighbour_match import match_distance, matched, wanted_distances
from feti_homog.typing import Float

if TYPE_CHECKING:
    from feti_homog.case.cell_section import Cell


def matched_arrangement(cell: Cell) -> Arrangement:
    """Discs at random in the unit square, periodic, the same for the same case on every machine.

    The radii are quantiles of the window `cell.matched`, dealt at random and scaled to the fraction. The centres
    are placed as those of other random cells, `min_gap` mean diameters apart, and then moved one by one until the
    distances of the nearest and the second neighbours are distributed as in the table (`neighbour_match.matched`). Of
    coated fibres the gap is that of the coatings.

    Raises:
        MeshError: no arrangement is found.
    """
    count, fraction = cell.fibres, cell.fibre_fraction
    window = cell.matched
    assert window is not None and count is not None and fraction is not None
    generator = np.random.default_rng(cell.seed)
    levels = (np.arange(count) + 0.5) / count
    radii = generator.permutation(np.quantile(window.radii, levels))
    radii *= sqrt(fraction / (pi * fsum(radii * radii)))
    gap, grown = cell.min_gap * 2 * fsum(radii) / count, 1 + (cell.coating or 0.0)
    try:
        start = placed(FibrePattern(1.0, 1.0, np.zeros((count, 2)), radii * grown, periodic=True), gap, generator)
    except MeshError as error:
        keys = f"[cell] fibre_fraction = {fraction:g} with min_gap = {cell.min_gap:g} and fibres = {count}"
        raise MeshError(f"{keys}: no arrangement found; lower one of them, or change seed") from error
    centres = matched(start, gap, wanted_distances(window, count) / grown, generator)
    coating = (cell.coating or 0.0) * radii
    return clear_shift(Arrangement.of_discs(1.0, 1.0, centres, radii, (FIBRE,) * count, coating))


def distance_of(window: FibrePattern, width: float, height: float, centres: Float, radii: Float) -> float:
    """Return how far a periodic cell with these fibres is from the window that it matches, in mean diameters."""
    pattern = FibrePattern(width, height, centres, radii, periodic=True)
    return match_distance(pattern, wanted_distances(window, pattern.count))
