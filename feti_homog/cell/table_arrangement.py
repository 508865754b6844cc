"""The arrangement of the fibres of a table."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from feti_homog.cell import elliptic_table, shaped_table, tabulated
from feti_homog.cell.arrangement import Arrangement, clear_shift, clearance
from feti_homog.cell.ellipses import Ellipses

if TYPE_CHECKING:
    from feti_homog.config.cell_section import Cell

# Distance of the sides of a cell from tangency with a circle / mean radius, below which elements there are needles.
LEAST_CLEARANCE = 1e-3
# Decimals of coordinates / width of the cell of tables that may have any origin and unit.
TABLE_DECIMALS = 10


def table_arrangement(cell: Cell) -> Arrangement:
    """The fibres of the case's table, in the order of its rows; periodic images are one, the first of them.

    A table that says where its cell begins keeps that place, if the sides are clear of tangency with its discs; the
    table of a cell gives the mesh of that cell. Else all is shifted (`clear_shift`), rounded and meshed in the order of
    the coordinates, so that tables that differ by a shift, by the order of rows or by units have one mesh.

    Raises:
        MeshError: rows lie outside, come twice, overlap or touch.
    """
    table = cell.table
    assert table is not None and table.width is not None
    rows, centres, radii, height = tabulated.fibres(table, cell.window)
    coating = None if table.coating is None else table.coating[rows] * radii
    hollow = None
    if table.inner_radius is not None:
        core = table.inner_radius[rows] / table.width
        hollow = core > 0
        coating = np.where(hollow, radii - core, 0.0 if coating is None else coating)
        radii = np.where(hollow, core, radii)
    phase = tuple(table.phase[row] for row in rows)
    discs = Arrangement(1.0, height, centres, radii, phase, coating=coating, hollow=hollow)
    clear_of, shift = clearance, clear_shift
    if table.a is not None:
        unit = elliptic_table.ellipses_of(table, rows, centres).frames / table.width
        unit = np.where(
            discs.is_hollow[:, None, None], unit * (radii * table.width / table.radius[rows])[:, None, None], unit
        )
        discs, clear_of, shift = replace(discs, frames=unit), elliptic_table.clearance, elliptic_table.clear_shift
    if table.polygons is not None:
        own = Ellipses.round(np.column_stack([centres, radii])) if discs.frames is None else discs.ellipses
        shapes = shaped_table.shapes_of(own, table.polygons[rows], table.width)
        discs, clear_of, shift = replace(discs, shapes=shapes), shaped_table.clearance, shaped_table.clear_shift
    shifted = shift(discs)
    is_placed = table.left is not None and table.bottom is not None
    clear = min(LEAST_CLEARANCE * float(discs.radii.mean()), clear_of(shifted))
    if is_placed and clear_of(discs) >= clear:
        return discs
    rounded = shifted.centres.round(TABLE_DECIMALS)
    order = np.lexsort((rounded[:, 1], rounded[:, 0]))
    frames = None if shifted.frames is None else shifted.frames.round(TABLE_DECIMALS)
    thickness = None if coating is None else coating.round(TABLE_DECIMALS)
    even = replace(shifted, centres=rounded, radii=radii.round(TABLE_DECIMALS), coating=thickness, frames=frames)
    return replace(
        even, mesh_order=order, shapes=None if shifted.shapes is None else shifted.shapes.rounded(TABLE_DECIMALS)
    )
