"""The arrangement of the fibres of a table."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from feti_homog.fibres import elliptic_table, periodic_table, shaped_table
from feti_homog.fibres.arrangement import Arrangement, clear_shift, clearance
from feti_homog.fibres.ellipses import Ellipses
from feti_homog.typing import Float, Int

if TYPE_CHECKING:
    from feti_homog.case.cell_section import Cell
    from feti_homog.case.fibre_table import FibreTable

# Distance of the sides of a cell from tangency with a circle / mean radius, below which elements there are needles.
LEAST_CLEARANCE = 1e-3
# Decimals of coordinates / width of the cell of tables that may have any origin and unit, and of height / width: gmsh
# may put other elements beside ellipses and polygons where the last digit of a length is another.
TABLE_DECIMALS, HEIGHT_DECIMALS = 10, 12


def table_arrangement(cell: Cell) -> Arrangement:
    """The fibres of the case's table, in the order of its rows; periodic images are one, the first of them.

    A table that says where its cell begins keeps that place, if the sides are clear of tangency with its discs; the
    table of a cell gives the mesh of that cell. Else all is shifted (`clear_shift`), rounded and meshed in the order of
    the coordinates, so that tables that differ by a shift, by the order of rows or by units have one mesh. Ellipses and
    polygons are rounded wherever they are.

    Raises:
        MeshError: rows lie outside, come twice, overlap or touch.
    """
    table = cell.table
    assert table is not None and table.width is not None
    discs = _discs(table, *periodic_table.fibres(table, cell.window))
    clear_of, shift = clearance, clear_shift
    if discs.shapes is not None:
        clear_of, shift = shaped_table.clearance, shaped_table.clear_shift
    elif discs.frames is not None:
        clear_of, shift = elliptic_table.clearance, elliptic_table.clear_shift
    shifted = shift(discs)
    is_placed = table.left is not None and table.bottom is not None
    clear = min(LEAST_CLEARANCE * float(discs.radii.mean()), clear_of(shifted))
    if not is_placed or clear_of(discs) < clear:
        return _in_mesh_order(_rounded(shifted))
    return discs if discs.frames is None and discs.shapes is None else _rounded(discs)


def _discs(table: FibreTable, rows: Int, centres: Float, radii: Float, height: float) -> Arrangement:
    """The rows (k,) with these centres and radii / width of the cell."""
    assert table.width is not None
    coating = None if table.coating is None else table.coating[rows] * radii
    hollow, share = None, np.ones(len(rows))
    if table.inner_radius is not None:
        core = table.inner_radius[rows] / table.width
        hollow = core > 0
        share = np.where(hollow, core / radii, 1.0)
        coating = np.where(hollow, radii - core, 0.0 if coating is None else coating)
        radii = np.where(hollow, core, radii)
    phase = tuple(table.phase[row] for row in rows)
    discs = Arrangement(1.0, height, centres, radii, phase, coating=coating, hollow=hollow)
    if table.a is not None:
        frames = elliptic_table.ellipses_of(table, rows, centres).frames / table.width
        discs = replace(discs, frames=np.where(share[:, None, None] < 1, share[:, None, None] * frames, frames))
    if table.polygons is None:
        return discs
    own = Ellipses.round(np.column_stack([centres, radii])) if discs.frames is None else discs.ellipses
    return replace(discs, shapes=shaped_table.shapes_of(own, table.polygons[rows], table.width))


def _rounded(arrangement: Arrangement) -> Arrangement:
    """The arrangement with coordinates of TABLE_DECIMALS, 0 on either side, in a cell of HEIGHT_DECIMALS."""
    size = np.array([arrangement.width, arrangement.height])
    centres = arrangement.centres.round(TABLE_DECIMALS)
    coating, frames, shapes = arrangement.coating, arrangement.frames, arrangement.shapes
    return replace(
        arrangement,
        height=round(arrangement.height, HEIGHT_DECIMALS),
        centres=np.where(centres >= size - 10.0**-TABLE_DECIMALS, 0.0, centres),
        radii=arrangement.radii.round(TABLE_DECIMALS),
        coating=None if coating is None else coating.round(TABLE_DECIMALS),
        frames=None if frames is None else frames.round(TABLE_DECIMALS),
        shapes=None if shapes is None else shapes.rounded(TABLE_DECIMALS),
    )


def _in_mesh_order(arrangement: Arrangement) -> Arrangement:
    """The arrangement meshed in the order of its coordinates."""
    x, y = arrangement.centres.T
    return replace(arrangement, mesh_order=np.lexsort((y, x)))
