"""Random cells: discs of the phases, fractions and radii of a case, or with the neighbours of a measured window."""

from __future__ import annotations

from math import fsum, pi, sqrt

import numpy as np

from feti_homog.case.cell_section import MOST_FIBRES, Cell
from feti_homog.case.cell_sizes import fibre_counts, fractions_in_words, void_count
from feti_homog.errors import MeshError
from feti_homog.microstructure.arrangement import Arrangement, clear_shift
from feti_homog.microstructure.fibre_pattern import FibrePattern
from feti_homog.microstructure.phase_names import FIBRE, VOID
from feti_homog.microstructure.random_fibres import MAX_STEPS, matched, placed, relax, wanted_distances
from feti_homog.typing import Float

# Quenched random packings jam near this area fraction.
JAMMED = 0.84


def random_arrangement(cell: Cell, max_steps: int = MAX_STEPS, max_attempts: int | None = None) -> Arrangement:
    """Discs at random in the unit square, periodic, the same for the same case on every machine.

    Radii are uniform in mean * (1 - s, 1 + s), s = `radius_spread`, and scaled to the fraction of each phase; those of
    voids are all alike. Any two discs, coatings and images included, are at least `min_gap` mean diameters of fibres
    apart. Random centres are moved down the gradient of the overlap energy 1/2 sum max(0, R_i + R_j - |x_i - x_j|)^2 of
    the discs grown by half the gap until it is zero; when that has not come after `max_steps`, it starts again from
    other centres, up to `max_attempts` times (default: 10 for few fibres, 3 for many). Last, all is shifted
    (`clear_shift`).

    Raises:
        MeshError: no arrangement is found.
    """
    phase = tuple(name for name, own in fibre_counts(cell).items() for _ in range(own))
    fibres, gap, fraction = len(phase), cell.min_gap, fsum(cell.fractions.values())
    generator = np.random.default_rng(cell.seed)
    radii = 1 + cell.radius_spread * generator.uniform(-1, 1, fibres)
    for name, share in cell.fractions.items():
        own = np.array(phase) == name
        radii[own] *= sqrt(share / (pi * fsum(radii[own] ** 2)))
    coating, clear = (cell.coating or 0.0) * radii, gap * fsum(radii) / fibres
    radii, coating = _with_voids(cell, radii, coating)
    count, phase = len(radii), phase + (VOID,) * (len(radii) - fibres)
    grown = radii + coating + clear
    ask = f"[cell] {fractions_in_words(cell)} with min_gap = {gap:g} and fibres = {fibres}"
    of_all = "fraction of fibres and voids" if cell.voids else "fibre fraction"
    if pi * np.sum(grown**2) > 0.9:
        raise MeshError(
            f"{ask}: random arrangements with this gap exist up to a {of_all} of at most about "
            f"{JAMMED / (1 + (cell.coating or 0.0) + gap) ** 2:.2f}; lower one of them"
        )
    attempts, best = max_attempts or max(3, min(10, 100 // count)), 0.0
    for _ in range(attempts):
        centres, reached = relax(generator.random((count, 2)), grown, max_steps)
        if reached >= 1:
            return clear_shift(Arrangement.of_discs(1.0, 1.0, centres, radii, phase, coating))
        best = max(best, reached)
    raise MeshError(
        f"{ask}: no arrangement found in {attempts} attempts; they reached a fibre fraction of at most about "
        f"{fraction * best**2:.2f} with this gap; lower one of them, or change seed"
    )


def _with_voids(cell: Cell, radii: Float, coating: Float) -> tuple[Float, Float]:
    """Radii and coatings of the fibres, and after them those of the voids."""
    count = void_count(cell, float(radii.mean()))
    if not count:
        return radii, coating
    if count > MOST_FIBRES:
        raise MeshError(
            f"[cell] {fractions_in_words(cell)}: makes {count:.2g} voids; expected at most {MOST_FIBRES}; make "
            "void_radius larger"
        )
    own = np.full(count, sqrt((cell.voids or 0.0) / (pi * count)))
    return np.append(radii, own), np.append(coating, np.zeros(count))


def matched_arrangement(cell: Cell) -> Arrangement:
    """Discs at random in the unit square, periodic, the same for the same case on every machine.

    The radii are quantiles of the window `cell.matched`, dealt at random and scaled to the fraction. The centres
    are placed as those of other random cells, `min_gap` mean diameters apart, and then moved one by one until the
    distances of the nearest and the second neighbours are distributed as in the table (`random_fibres.matched`). Of
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
