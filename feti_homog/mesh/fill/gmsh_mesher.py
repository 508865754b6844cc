"""The coarse periodic mesh of a cell of round fibres: gmsh fills the outline with triangles."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING

from feti_homog.case.mixed_cell import fractions_in_words, mixed_width
from feti_homog.errors import MeshError
from feti_homog.fibres.arrangement import Arrangement, arrange
from feti_homog.mesh.coarse_mesh import CoarseMesh
from feti_homog.mesh.fill.drawing import Drawing, Sketch, drawing
from feti_homog.mesh.outline import elliptic_outline
from feti_homog.mesh.outline.bare_outline import BareOutline
from feti_homog.mesh.outline.edge_samples import IN_TILES
from feti_homog.mesh.sizes import element_estimate
from feti_homog.mesh.sizes.graded_size import MeshSizes
from feti_homog.mesh.tiles.tiles import DEFAULT_TILES, TilePolicy, is_tiled, tiling

if TYPE_CHECKING:
    from feti_homog.case.cell_section import Cell


# Elements that are meshed in some minutes on one rank, and by all ranks together.
MAX_TRIANGLES, MAX_TRIANGLES_OF_TILES = 1_000_000, 20_000_000
# Radius / width of the cell above which positions on a circle differ by more than rounding.
SMALLEST_RADIUS = 1e-6
NO_MARKS: Mapping[int, Sequence[float]] = MappingProxyType({})


def generate(
    cell: Cell, marks: Mapping[int, Sequence[float]] = NO_MARKS, policy: TilePolicy = DEFAULT_TILES
) -> CoarseMesh:
    """The mesh that `begin` begins, all of it made here."""
    drawn = draw(cell, marks, policy)
    return drawn if isinstance(drawn, CoarseMesh) else drawn.filled()


def draw(
    cell: Cell, marks: Mapping[int, Sequence[float]] = NO_MARKS, policy: TilePolicy = DEFAULT_TILES
) -> Drawing | CoarseMesh:
    """What `begin` begins, with all nodes on its lines."""
    begun = begin(cell, marks, policy)
    return begun.drawn(begun.bare.stations()) if isinstance(begun, Sketch) else begun


def begin(
    cell: Cell, marks: Mapping[int, Sequence[float]] = NO_MARKS, policy: TilePolicy = DEFAULT_TILES
) -> Sketch | Drawing | CoarseMesh:
    """The periodic coarse mesh of a square, hexagonal or random cell, or of a table: of round fibres a sketch, of
    ellipses all but the triangles, of polygons all.

    Elements have about the size mesh_size * width, on circles interface_size * width.

    It is made at the width 1 and then scaled, so that cells of one shape have one mesh at all sizes.

    `marks` maps a curve (`BareOutline.of`) to angles in degrees, measured at its centre, where the mesh gets nodes:
    tips of debonded arcs. A mark within MERGED of where the circle crosses the cell's
    boundary, or of another mark, is moved there.

    Raises:
        MeshError: the fibres cannot be arranged, or there would be too many elements.
    """
    sizes = _sizes(cell, marks)
    _refuse_extremes(cell, sizes, sum(len(own) for own in marks.values()), _most_triangles(cell, policy))
    arrangement = arrange(cell)
    smallest = int(arrangement.radii.argmin())
    if arrangement.radii[smallest] < SMALLEST_RADIUS * arrangement.width:
        asked = fractions_in_words(cell) if cell.fractions else 'geometry = "table"'
        raise MeshError(
            f"[cell] {asked}: a {'void' if arrangement.is_void[smallest] else 'fibre'} has a radius of "
            f"{arrangement.radii.min():.2g}; expected at least {SMALLEST_RADIUS} of the width of the cell"
        )
    if arrangement.shapes is not None:
        from feti_homog.mesh.fill.shape_mesher import mesh_shapes

        return mesh_shapes(arrangement, sizes, arrangement_scale(cell, arrangement))
    scale = arrangement_scale(cell, arrangement)
    if arrangement.frames is not None:
        return drawing(arrangement, elliptic_outline.outline(arrangement, sizes, marks), sizes, None, scale)
    return _sketch(arrangement, sizes, marks, scale, policy)


def mesh_arrangement(
    arrangement: Arrangement,
    sizes: MeshSizes,
    marks: Mapping[int, Sequence[float]] = NO_MARKS,
    scale: float = 1.0,
) -> CoarseMesh:
    """The periodic coarse mesh of round discs, with elements of these sizes, scaled at the end; see `begin`."""
    sketch = _sketch(arrangement, sizes, marks, scale, DEFAULT_TILES)
    return sketch.drawn(sketch.bare.stations()).filled()


def _sketch(
    arrangement: Arrangement,
    sizes: MeshSizes,
    marks: Mapping[int, Sequence[float]],
    scale: float,
    policy: TilePolicy,
) -> Sketch:
    """The bare lines of round discs, and their tiles; see `begin`."""
    tiles = tiling(arrangement, sizes.largest, marks, policy)
    if tiles is None:
        bare = BareOutline.of(arrangement, sizes, marks)
    else:
        bare = BareOutline.of(arrangement, sizes, marks, tiles.bridges, IN_TILES)
    return Sketch(arrangement, bare, sizes, tiles, scale)


def _sizes(cell: Cell, marks: Mapping[int, Sequence[float]]) -> MeshSizes:
    """Those that a cell of width 1 is asked for."""
    interface = cell.mesh_size if cell.interface_size is None else cell.interface_size
    tip = interface if cell.tip_size is None or not marks else cell.tip_size
    return MeshSizes(cell.mesh_size, interface, tip)


def arrangement_scale(cell: Cell, arrangement: Arrangement) -> float:
    """Lengths of the cell / those of the arrangement."""
    if cell.fibre_radius is not None:
        return float(cell.fibre_radius / arrangement.radii[: arrangement.fibres].mean())
    width = mixed_width(cell) if cell.table is None else cell.table.width
    return width or 1.0


def _most_triangles(cell: Cell, policy: TilePolicy) -> int:
    """As many as are meshed in some minutes; random fibres are round."""
    if cell.geometry == "table":
        tiled = is_tiled(arrange(cell), policy)
    else:
        tiled = element_estimate.fibres_of(cell) >= policy.least_discs
    return MAX_TRIANGLES_OF_TILES if tiled else MAX_TRIANGLES


def _refuse_extremes(cell: Cell, sizes: MeshSizes, tips: int, most: int) -> None:
    """Raise MeshError for a cell that would take hours to mesh, before it is begun."""
    around = min(sizes.interface, element_estimate.interface_size(cell))
    at_tips = tips * element_estimate.triangles_of_a_tip(max(1.0, around / sizes.tip))
    count = element_estimate.triangles(cell) + at_tips
    if count > most:
        keys = ("mesh_size", "interface_size", "tip_size") if at_tips else ("mesh_size", "interface_size")
        given = [f"{name} = {value:.3g}" for name in keys if (value := getattr(cell, name)) is not None]
        given += [] if cell.fibres is None else [f"fibres = {cell.fibres}"]
        raise MeshError(
            f"[cell] {', '.join(given)}: about {count:.2g} elements before refine; expected at most {most}; "
            "refine splits them on the ranks"
        )
