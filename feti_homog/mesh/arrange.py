"""Arrange the fibres of a cell: square, hexagonal, random, matched or listed in a table."""

from math import fsum, pi, sqrt

import numpy as np

from feti_homog.case import cell_section, cell_sizes
from feti_homog.errors import MeshError
from feti_homog.microstructure import Arrangement, arrangements, phase_names
from feti_homog.schema import types

# Random packings of discs jam near this area fraction.
JAMMED = 0.84


def arrange(cell: cell_section.Cell) -> Arrangement:
    """Arrange the fibres and voids of a generated cell; the arrangement has the width 1.

    Lattices and random cells (`random_arrangement` or, with `cell.match`, `matched_arrangement`) have the exact
    fractions `cell.fractions`; `periodic_table.table_arrangement` arranges tables.

    Raises:
        MeshError: discs touch, are too many or too dense, no arrangement is found, or the table is faulty.
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
        touch = f"the fibres of the {cell.geometry} cell touch at {limit:.4f}"
        raise MeshError(f"[cell] fibre_fraction = {fraction:g}: {touch}; it must be smaller")
    centres, phase = np.array(lattice.centres), (phase_names.FIBRE,) * len(lattice.centres)
    radii = np.full(len(phase), sqrt(fraction * lattice.height / (pi * len(phase))))
    return Arrangement.of_discs(1.0, lattice.height, centres, radii, phase, (cell.coating or 0.0) * radii)


def random_arrangement(
    cell: cell_section.Cell, max_steps: int | None = None, max_attempts: int | None = None
) -> Arrangement:
    """Place discs at random on the unit torus; every machine finds the same discs.

    Fibre radii are uniform in mean * (1 - s, 1 + s), s = `radius_spread`, scaled to the phase fractions; voids have one
    radius. Discs with coatings keep gaps of at least `min_gap` mean fibre diameters, also to images. A descent from
    random centres x_i reduces the overlap energy 1/2 sum max(0, R_i + R_j - |x_i - x_j|)^2 to zero; R_i includes the
    coating and half the gap. After `max_steps` (default: `random_fibres.MAX_STEPS`), the descent restarts, in up to
    `max_attempts` attempts (default: 10 for few discs, 3 for many). Finally, `clear_shift` moves the cell sides away
    from tangents to discs.

    Raises:
        MeshError: the discs are too many or too dense, or the search for an arrangement fails.
    """
    from feti_homog.microstructure import random_fibres  # other cells do not need the module

    phase = tuple(name for name, members in cell_sizes.fibre_counts(cell).items() for _ in range(members))
    fibres, gap, fraction = len(phase), cell.min_gap, fsum(cell.fractions.values())
    generator = np.random.default_rng(cell.seed)
    radii = 1 + cell.radius_spread * generator.uniform(-1, 1, fibres)
    for name, share in cell.fractions.items():
        members = np.array(phase) == name
        radii[members] *= sqrt(share / (pi * fsum(radii[members] ** 2)))
    coating, clear = (cell.coating or 0.0) * radii, gap * fsum(radii) / fibres
    void_radius = float(radii.mean()) * (1.0 if cell.void_radius is None else cell.void_radius)
    if cell.voids:
        voids = max(1, round(cell.voids / (pi * void_radius**2)))
        if voids > types.MOST_FIBRES:
            bound = f"expected at most {types.MOST_FIBRES}; make void_radius larger"
            raise MeshError(f"[cell] {cell_sizes.fractions_in_words(cell)}: makes {voids:.2g} voids; {bound}")
        radii = np.append(radii, np.full(voids, sqrt(cell.voids / (pi * voids))))
        coating, phase = np.append(coating, np.zeros(voids)), phase + (phase_names.VOID,) * voids
    count = len(radii)
    grown = radii + coating + clear
    ask = f"[cell] {cell_sizes.fractions_in_words(cell)} with min_gap = {gap:g} and fibres = {fibres}"
    of_all = "fraction of fibres and voids" if cell.voids else "fibre fraction"
    if pi * np.sum(grown**2) > random_fibres.DENSEST:
        bound = f"a {of_all} of at most about {JAMMED / (1 + (cell.coating or 0.0) + gap) ** 2:.2f}"
        raise MeshError(f"{ask}: random arrangements with this gap exist up to {bound}; lower one of them")
    attempts, best = max_attempts or max(3, min(10, 100 // count)), 0.0
    for _ in range(attempts):
        start = generator.random((count, 2))
        centres, reached = random_fibres.relax(start, grown, max_steps or random_fibres.MAX_STEPS)
        if reached >= 1:
            return arrangements.clear_shift(Arrangement.of_discs(1.0, 1.0, centres, radii, phase, coating))
        best = max(best, reached)
    bound = f"they reached a fibre fraction of at most about {fraction * best**2:.2f} with this gap"
    raise MeshError(f"{ask}: no arrangement found in {attempts} attempts; {bound}; lower one of them, or change seed")


def matched_arrangement(cell: cell_section.Cell) -> Arrangement:
    """Place discs at random, with the neighbour distances of a measured window.

    The radii are quantiles of the radii in the window `cell.matched`, in random order, scaled to the fibre fraction.
    The first centres are random, with gaps of at least `min_gap` mean diameters between discs or coatings. Then
    `random_fibres.matched` moves fibres one by one, until the distances to the two nearest neighbours are distributed
    as in the window, or the moves run out. Finally, `clear_shift` moves the cell sides away from tangents to discs.

    Raises:
        MeshError: the search for an arrangement fails.
    """
    from feti_homog.microstructure import fibre_pattern, random_fibres

    count, fraction, window = cell.fibres, cell.fibre_fraction, cell.matched
    assert window is not None and count is not None and fraction is not None
    generator = np.random.default_rng(cell.seed)
    levels = (np.arange(count) + 0.5) / count
    radii = generator.permutation(np.quantile(window.radii, levels))
    radii *= sqrt(fraction / (pi * fsum(radii * radii)))
    gap, grown = cell.min_gap * 2 * fsum(radii) / count, 1 + (cell.coating or 0.0)
    pattern = fibre_pattern.FibrePattern(1.0, 1.0, np.zeros((count, 2)), radii * grown, periodic=True)
    try:
        start = random_fibres.placed(pattern, gap, generator)
    except MeshError as error:
        keys = f"[cell] fibre_fraction = {fraction:g} with min_gap = {cell.min_gap:g} and fibres = {count}"
        raise MeshError(f"{keys}: no arrangement found; lower one of them, or change seed") from error
    centres = random_fibres.matched(start, gap, random_fibres.wanted_distances(window, count) / grown, generator)
    phase, coating = (phase_names.FIBRE,) * count, (cell.coating or 0.0) * radii
    return arrangements.clear_shift(Arrangement.of_discs(1.0, 1.0, centres, radii, phase, coating))
