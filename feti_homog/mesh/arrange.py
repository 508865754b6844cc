"""Arrange the fibres of a cell: square, hexagonal, random, matched or listed in a table."""

from math import fsum, pi, sqrt

import numpy as np

from feti_homog.case import cell_section, cell_sizes
from feti_homog.errors import MeshError
from feti_homog.microstructure import Arrangement, arrangements, phase_names
from feti_homog.typing import Float

# Quenched random packings jam near this area fraction.
JAMMED = 0.84


def arrange(cell: cell_section.Cell) -> Arrangement:
    """Arrange fibres in a cell of width 1, with exact fractions `cell.fractions`.

    A lattice comes from `cell_section.LATTICES`, a random cell from `random_arrangement` or, with `cell.match`, from
    `matched_arrangement`, and a table from `periodic_table.table_arrangement`.

    Raises:
        MeshError: discs touch, no arrangement is found, or the table is faulty.
    """
    if cell.geometry == "random":
        return random_arrangement(cell) if cell.match is None else matched_arrangement(cell)
    if cell.table is not None:
        from feti_homog.microstructure import periodic_table

        return periodic_table.table_arrangement(cell.table, cell.window, cell.repair == "overlaps")
    lattice, fraction = cell_section.LATTICES[cell.geometry], cell.fibre_fraction
    limit = lattice.touching / (1 + (cell.coating or 0.0)) ** 2
    assert fraction is not None
    if fraction >= limit:
        raise MeshError(
            f"[cell] fibre_fraction = {fraction:g}: the fibres of the {cell.geometry} cell touch at "
            f"{limit:.4f}; it must be smaller"
        )
    count = len(lattice.centres)
    radii = np.full(count, sqrt(fraction * lattice.height / (pi * count)))
    coating = (cell.coating or 0.0) * radii
    return Arrangement.of_discs(
        1.0, lattice.height, np.array(lattice.centres), radii, (phase_names.FIBRE,) * count, coating
    )


def random_arrangement(
    cell: cell_section.Cell, max_steps: int | None = None, max_attempts: int | None = None
) -> Arrangement:
    """Place discs at random on the unit torus, alike on every machine.

    Radii are uniform in mean * (1 - s, 1 + s), s = `radius_spread`, and scaled to the phase fractions; all voids are
    alike. Any two discs, with their coatings and images, are at least `min_gap` mean fibre diameters apart. For discs
    grown by half the gap, a descent from random centres makes the overlap energy
    1/2 sum max(0, R_i + R_j - |x_i - x_j|)^2 zero. After `max_steps` it starts again from other centres, up to
    `max_attempts` times (default: 10 for few fibres, 3 for many). Last, `clear_shift` moves the arrangement.

    Raises:
        MeshError: no arrangement is found.
    """
    from feti_homog.microstructure import random_fibres  # other cells do without

    phase = tuple(name for name, members in cell_sizes.fibre_counts(cell).items() for _ in range(members))
    fibres, gap, fraction = len(phase), cell.min_gap, fsum(cell.fractions.values())
    generator = np.random.default_rng(cell.seed)
    radii = 1 + cell.radius_spread * generator.uniform(-1, 1, fibres)
    for name, share in cell.fractions.items():
        members = np.array(phase) == name
        radii[members] *= sqrt(share / (pi * fsum(radii[members] ** 2)))
    coating, clear = (cell.coating or 0.0) * radii, gap * fsum(radii) / fibres
    radii, coating = _with_voids(cell, radii, coating)
    count, phase = len(radii), phase + (phase_names.VOID,) * (len(radii) - fibres)
    grown = radii + coating + clear
    ask = f"[cell] {cell_sizes.fractions_in_words(cell)} with min_gap = {gap:g} and fibres = {fibres}"
    of_all = "fraction of fibres and voids" if cell.voids else "fibre fraction"
    if pi * np.sum(grown**2) > random_fibres.DENSEST:
        raise MeshError(
            f"{ask}: random arrangements with this gap exist up to a {of_all} of at most about "
            f"{JAMMED / (1 + (cell.coating or 0.0) + gap) ** 2:.2f}; lower one of them"
        )
    attempts, best = max_attempts or max(3, min(10, 100 // count)), 0.0
    for _ in range(attempts):
        centres, reached = random_fibres.relax(
            generator.random((count, 2)), grown, max_steps or random_fibres.MAX_STEPS
        )
        if reached >= 1:
            return arrangements.clear_shift(Arrangement.of_discs(1.0, 1.0, centres, radii, phase, coating))
        best = max(best, reached)
    raise MeshError(
        f"{ask}: no arrangement found in {attempts} attempts; they reached a fibre fraction of at most about "
        f"{fraction * best**2:.2f} with this gap; lower one of them, or change seed"
    )


def _with_voids(cell: cell_section.Cell, radii: Float, coating: Float) -> tuple[Float, Float]:
    """Append the void radii to the radii, and zeros to the coatings."""
    count = cell_sizes.void_count(cell, float(radii.mean()))
    if not count:
        return radii, coating
    if count > cell_section.MOST_FIBRES:
        raise MeshError(
            f"[cell] {cell_sizes.fractions_in_words(cell)}: makes {count:.2g} voids; expected at most "
            f"{cell_section.MOST_FIBRES}; make void_radius larger"
        )
    void_radii = np.full(count, sqrt((cell.voids or 0.0) / (pi * count)))
    return np.append(radii, void_radii), np.append(coating, np.zeros(count))


def matched_arrangement(cell: cell_section.Cell) -> Arrangement:
    """Place discs at random, with the neighbour distances of a measured window.

    The radii are quantiles of the window `cell.matched`, dealt at random and scaled to the fraction. The first centres
    are random and `min_gap` mean diameters apart, between coatings if there are any. `random_fibres.matched` then moves
    one fibre after the other, until the distances of the two nearest neighbours are distributed as in the table.

    Raises:
        MeshError: no arrangement is found.
    """
    from feti_homog.microstructure import fibre_pattern, random_fibres

    count, fraction = cell.fibres, cell.fibre_fraction
    window = cell.matched
    assert window is not None and count is not None and fraction is not None
    generator = np.random.default_rng(cell.seed)
    levels = (np.arange(count) + 0.5) / count
    radii = generator.permutation(np.quantile(window.radii, levels))
    radii *= sqrt(fraction / (pi * fsum(radii * radii)))
    gap, grown = cell.min_gap * 2 * fsum(radii) / count, 1 + (cell.coating or 0.0)
    try:
        start = random_fibres.placed(
            fibre_pattern.FibrePattern(1.0, 1.0, np.zeros((count, 2)), radii * grown, periodic=True), gap, generator
        )
    except MeshError as error:
        keys = f"[cell] fibre_fraction = {fraction:g} with min_gap = {cell.min_gap:g} and fibres = {count}"
        raise MeshError(f"{keys}: no arrangement found; lower one of them, or change seed") from error
    centres = random_fibres.matched(start, gap, random_fibres.wanted_distances(window, count) / grown, generator)
    coating = (cell.coating or 0.0) * radii
    return arrangements.clear_shift(
        Arrangement.of_discs(1.0, 1.0, centres, radii, (phase_names.FIBRE,) * count, coating)
    )
