"""Arrange the fibres of a cell: square, hexagonal, random, matched or listed in a table."""

from __future__ import annotations

from math import pi, sqrt

import numpy as np

from feti_homog.case.cell_section import Cell
from feti_homog.errors import MeshError
from feti_homog.microstructure.arrangement import Arrangement
from feti_homog.microstructure.phase_names import FIBRE
from feti_homog.typing import Float


def arrange(cell: Cell) -> Arrangement:
    """Return the arrangement that a case asks for in a cell of width 1, its fractions `cell.fractions` to rounding.

    square: one disc in the middle of a 1 x 1 cell. hexagonal: 1 x sqrt(3), a disc in the middle and one at
    the corner. random: discs in a 1 x 1 cell, see `random_cell.random_arrangement`, with
    `cell.match` see `random_cell.matched_arrangement`. table: see `periodic_table.table_arrangement`.

    Raises:
        MeshError: discs of that fraction touch, no arrangement is found, or the table is faulty.
    """
    if cell.geometry == "random":
        from feti_homog.mesh import random_cell  # with the statistics that it matches

        return random_cell.random_arrangement(cell) if cell.match is None else random_cell.matched_arrangement(cell)
    if cell.table is not None:
        from feti_homog.microstructure.periodic_table import table_arrangement

        return table_arrangement(cell.table, cell.window, cell.repair == "overlaps")
    return square_arrangement(cell) if cell.geometry == "square" else hexagonal_arrangement(cell)


def listed_arrangement(cell: Cell) -> Arrangement | None:
    """Return the arrangement of a table; None of other cells, which may be too large to be arranged.

    Raises as `arrange`.
    """
    return None if cell.table is None else arrange(cell)


def square_arrangement(cell: Cell) -> Arrangement:
    """One disc in the middle of the unit square."""
    return _lattice(cell, 1.0, np.array([[0.5, 0.5]]), pi / 4)


def hexagonal_arrangement(cell: Cell) -> Arrangement:
    """Discs at the corner and in the middle of a 1 x sqrt(3) cell: the hexagonal lattice of distance 1."""
    return _lattice(cell, sqrt(3), np.array([[0.0, 0.0], [0.5, sqrt(3) / 2]]), pi / (2 * sqrt(3)))


def _lattice(cell: Cell, height: float, centres: Float, limit: float) -> Arrangement:
    """Equal discs at the centres (N, 2) of a 1 x height cell, which touch at the fraction `limit` if they are bare."""
    fraction = cell.fibre_fraction
    limit /= (1 + (cell.coating or 0.0)) ** 2
    assert fraction is not None
    if fraction >= limit:
        raise MeshError(
            f"[cell] fibre_fraction = {fraction:g}: the fibres of the {cell.geometry} cell touch at "
            f"{limit:.4f}; it must be smaller"
        )
    radius = sqrt(fraction * height / (pi * len(centres)))
    radii = np.full(len(centres), radius)
    return Arrangement.of_discs(1.0, height, centres, radii, (FIBRE,) * len(centres), (cell.coating or 0.0) * radii)
