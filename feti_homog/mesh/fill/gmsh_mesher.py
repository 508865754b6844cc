"""The coarse periodic mesh of a cell that the program meshes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from feti_homog.case.cell_section import Cell
from feti_homog.case.mixed_cell import fractions_in_words, mixed_width
from feti_homog.errors import MeshError
from feti_homog.fibres.arrange import arrange, listed_arrangement
from feti_homog.fibres.arrangement import Arrangement
from feti_homog.fibres.outlines.discs import Discs
from feti_homog.fibres.outlines.ellipses import Ellipses
from feti_homog.mesh.coarse_mesh import CoarseMesh
from feti_homog.mesh.fill.unmeshed_cell import NO_MARKS, NodedCell, UnmeshedCell
from feti_homog.mesh.sizes.element_estimate import (
    MAX_TRIANGLES,
    MAX_TRIANGLES_OF_TILES,
    ElementEstimate,
    refuse_many,
    triangles_of_a_tip,
)
from feti_homog.mesh.sizes.graded_size import MeshSizes
from feti_homog.mesh.tiles.tiles import DEFAULT_TILES, TilePolicy, is_tiled

# Radius / width of the cell above which positions on a circle differ by more than rounding.
SMALLEST_RADIUS = 1e-6


def generate(
    cell: Cell, marks: Mapping[int, Sequence[float]] = NO_MARKS, policy: TilePolicy = DEFAULT_TILES
) -> CoarseMesh:
    """Return the mesh that `begin` begins, all of it made here."""
    found = begin(cell, listed_arrangement(cell), marks, policy)
    noded = found.with_nodes() if isinstance(found, UnmeshedCell) else found
    return noded if isinstance(noded, CoarseMesh) else noded.filled()


def begin(
    cell: Cell,
    listed: Arrangement | None,
    marks: Mapping[int, Sequence[float]] = NO_MARKS,
    policy: TilePolicy = DEFAULT_TILES,
) -> UnmeshedCell | NodedCell | CoarseMesh:
    """Return the periodic coarse mesh of a square, hexagonal or random cell, or of a table.

    It is, of round fibres, the bare lines, of ellipses all but the triangles, of polygons all.

    Elements have about the size mesh_size * width, on circles interface_size * width.

    It is made at the width 1 and then scaled, so that cells of one shape have one mesh at all sizes.

    Args:
        listed: the arrangement of a table, see `listed_arrangement`.
        marks: maps a curve (`BareOutline.of`) to angles in degrees, measured at its centre, where the mesh gets nodes:
            tips of debonded arcs. A mark within MERGED of where the circle crosses the cell's boundary, or of another
            mark, is moved there.

    Raises:
        MeshError: the fibres cannot be arranged, or there would be too many elements.
    """
    sizes = _sizes(cell, marks)
    estimate = ElementEstimate.of(cell, listed)
    tiled = estimate.fibres >= policy.least_discs if listed is None else is_tiled(listed, policy)
    most = MAX_TRIANGLES_OF_TILES if tiled else MAX_TRIANGLES
    _refuse_extremes(estimate, sizes, sum(len(own) for own in marks.values()), most)
    arrangement = arrange(cell) if listed is None else listed
    smallest = int(arrangement.radii.argmin())
    if arrangement.radii[smallest] < SMALLEST_RADIUS * arrangement.width:
        asked = fractions_in_words(cell) if cell.fractions else 'geometry = "table"'
        raise MeshError(
            f"[cell] {asked}: a {'void' if arrangement.is_void[smallest] else 'fibre'} has a radius of "
            f"{arrangement.radii.min():.2g}; expected at least {SMALLEST_RADIUS} of the width of the cell"
        )
    scale = arrangement_scale(cell, arrangement)
    if isinstance(arrangement.outlines, Discs):
        cell_of_discs = UnmeshedCell.of(arrangement, sizes, marks, scale, policy)
        field = cell_of_discs.bare.field
        refuse_many(field.at, field.least, arrangement.size, most)
        return cell_of_discs
    if isinstance(arrangement.outlines, Ellipses):
        from feti_homog.mesh.outline import elliptic_outline  # discs, the common case, do without

        lines = elliptic_outline.outline(arrangement, arrangement.outlines, sizes, marks)
        return NodedCell.of(arrangement, lines, sizes, None, scale)
    from feti_homog.mesh.fill.shape_mesher import mesh_outlines  # with a reader of meshes

    return mesh_outlines(arrangement, sizes, scale)


def _sizes(cell: Cell, marks: Mapping[int, Sequence[float]]) -> MeshSizes:
    """Return those that a cell of width 1 is asked for."""
    interface = cell.mesh_size if cell.interface_size is None else cell.interface_size
    tip = interface if cell.tip_size is None or not marks else cell.tip_size
    return MeshSizes(cell.mesh_size, interface, tip)


def arrangement_scale(cell: Cell, arrangement: Arrangement) -> float:
    """Lengths of the cell / those of the arrangement."""
    if cell.fibre_radius is not None:
        return float(cell.fibre_radius / arrangement.radii[: arrangement.fibres].mean())
    width = mixed_width(cell) if cell.table is None else cell.table.width
    return width or 1.0


def _refuse_extremes(estimate: ElementEstimate, sizes: MeshSizes, tips: int, most: int) -> None:
    """Raise MeshError for a cell that would take hours to mesh, before it is begun."""
    cell, around = estimate.cell, min(sizes.interface, estimate.interface_size)
    at_tips = tips * triangles_of_a_tip(max(1.0, around / sizes.tip))
    count = estimate.triangles + at_tips
    if count > most:
        keys = ("mesh_size", "interface_size", "tip_size") if at_tips else ("mesh_size", "interface_size")
        given = [f"{name} = {value:.3g}" for name in keys if (value := getattr(cell, name)) is not None]
        given += [] if cell.fibres is None else [f"fibres = {cell.fibres}"]
        raise MeshError(
            f"[cell] {', '.join(given)}: about {count:.2g} elements before refine; expected at most {most}; "
            "refine splits them on the ranks"
        )
