"""Turn a cell section into a coarse periodic mesh: lines, nodes on the lines, tiles, triangles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from feti_homog.case import cell_section, cell_sizes
from feti_homog.errors import MeshError
from feti_homog.mesh.arrange import arrange
from feti_homog.mesh.coarse_mesh import CoarseMesh, representatives
from feti_homog.mesh.fill import element_estimate
from feti_homog.mesh.outline.bare_outline import BareOutline
from feti_homog.mesh.outline.graded_size import MeshSizes
from feti_homog.mesh.outline.lines import LineStations
from feti_homog.mesh.outline.outline import Marks, Outline
from feti_homog.mesh.tiles.tile_filling import Filling, Tile
from feti_homog.mesh.tiles.tiling import FilledTile, Regions, TilePolicy, Tiling, cut, is_tiled, tile_mesh, tiling
from feti_homog.microstructure import Arrangement, arrangements, phase_names
from feti_homog.microstructure.shapes import Conics


def begin(
    cell: cell_section.Cell, listed: Arrangement | None, marks: Marks, policy: TilePolicy
) -> UnmeshedCell | CoarseMesh:
    """Begin the periodic coarse mesh of a generated cell.

    Round and elliptic fibres give an `UnmeshedCell`, whose lines have no nodes yet; a table with polygons gives the
    mesh. The element size is about mesh_size * width, and interface_size * width on circles. The mesh has the width 1
    before the final scaling, so that cells of one shape have the same mesh at all sizes.

    Args:
        listed: the arrangement of a table; None for other cells, which this function arranges.
        marks: directions of debond tips, where the mesh gets nodes. A mark moves onto another mark, or onto a crossing
            of the circle with the cell boundary, within `outline.MERGED` radians.
        policy: rules for the division into tiles.

    Raises:
        MeshError: the fibres cannot be arranged or are too small, or the mesh would have too many elements.
        Exception: gmsh cannot mesh a table with polygons.
    """
    sizes = MeshSizes.of(cell, len(marks) > 0)
    estimate = element_estimate.ElementEstimate.of(cell, listed)
    tiled = estimate.fibres >= policy.least_discs if listed is None else is_tiled(listed, policy)
    limit = element_estimate.MAX_TRIANGLES_OF_TILES if tiled else element_estimate.MAX_TRIANGLES
    around = min(sizes.interface, estimate.interface_size)
    at_tips = sum(map(len, marks.values())) * element_estimate.triangles_of_a_tip(max(1.0, around / sizes.tip))
    if (count := estimate.triangles + at_tips) > limit:
        keys = ("mesh_size", "interface_size", "tip_size") if at_tips else ("mesh_size", "interface_size")
        values = [f"{name} = {value:.3g}" for name in keys if (value := getattr(cell, name)) is not None]
        if cell.fibres is not None:
            values.append(f"fibres = {cell.fibres}")
        elements = f"{count:.2g} elements before refine; expected at most {limit}; refine splits them on the ranks"
        raise MeshError(f"[cell] {', '.join(values)}: about {elements}")
    arrangement = arrange(cell) if listed is None else listed
    smallest = int(arrangement.radii.argmin())
    if arrangement.radii[smallest] < arrangements.SMALLEST_RADIUS * arrangement.width:
        request = cell_sizes.fractions_in_words(cell) if cell.fractions else 'geometry = "table"'
        kind = "void" if arrangement.is_void[smallest] else "fibre"
        expected = f"expected at least {arrangements.SMALLEST_RADIUS} of the width of the cell"
        raise MeshError(f"[cell] {request}: a {kind} has a radius of {arrangement.radii.min():.2g}; {expected}")
    scale = arrangement_scale(cell, arrangement)
    if not isinstance(arrangement.outlines, Conics):
        from feti_homog.mesh.fill.shape_mesher import mesh_outlines  # imports a mesh reader

        return mesh_outlines(arrangement, sizes, scale)
    tiles = tiling(arrangement, sizes.largest, marks, policy)
    bare = BareOutline.of(arrangement, sizes, marks, None if tiles is None else tiles.bridges)
    element_estimate.refuse_many(bare.field, bare.field.least, arrangement.size, limit)
    return UnmeshedCell(arrangement, bare, sizes, tiles, scale)


def arrangement_scale(cell: cell_section.Cell, arrangement: Arrangement) -> float:
    """Return the ratio of lengths in the cell to lengths in the arrangement."""
    if cell.fibre_radius is not None:
        return float(cell.fibre_radius / arrangement.radii[: arrangement.fibres].mean())
    width = cell_sizes.mixed_width(cell) if cell.table is None else cell.table.width
    return width or 1.0


@dataclass(frozen=True)
class UnmeshedCell:
    """A cell with discs or ellipses, divided into lines that have no nodes yet.

    Attributes:
        arrangement, bare, sizes: the fibres, the lines and the element sizes.
        tiles: the tiling; None for a cell of one tile.
        scale: as in `NodedCell`.
    """

    arrangement: Arrangement
    bare: BareOutline
    sizes: MeshSizes
    tiles: Tiling | None
    scale: float

    @property
    def phases(self) -> tuple[str, ...]:
        """The phase names, the matrix first."""
        return self.arrangement.phases

    def with_nodes(self, stations: LineStations) -> NodedCell:
        """Put the nodes at `stations` on the lines, and cut the cell into tiles; MeshError for too many nodes."""
        lines = self.bare.outline(stations)
        arrangement, sizes, nodes = self.arrangement, self.sizes, np.arange(len(lines.points))
        classes = representatives(lines.points, arrangement.width, arrangement.height).astype(np.int64)
        cell = Tile(lines.points, nodes, classes, lines.curves, sizes.largest, sizes.are_graded(arrangement))
        return NodedCell(arrangement, lines, tuple(cut(lines, cell, self.tiles)), self.scale)


@dataclass(frozen=True)
class NodedCell:
    """A cell with nodes on all lines, divided into tiles that have no triangles yet.

    Attributes:
        arrangement, lines, parts: the fibres, the outline and the empty tiles.
        scale: lengths in the mesh / lengths in the arrangement.
    """

    arrangement: Arrangement
    lines: Outline
    parts: tuple[Tile, ...]
    scale: float

    def mesh(self, fillings: Sequence[Filling]) -> CoarseMesh:
        """Join the fillings of all tiles, in the order of `parts`, to one mesh."""
        ends = self.regions.nodes + np.cumsum([0, *(len(filling.inner) for filling in fillings)])
        filled = map(FilledTile, range(len(fillings)), self.parts, fillings, ends.tolist())
        centres = self.scale * self.arrangement.centres[: self.arrangement.fibres]
        mesh = tile_mesh(self.regions, list(filled))[0]
        return replace(mesh, centres=centres, origin=self.arrangement.origin, remarks=self.arrangement.remarks)

    @cached_property
    def regions(self) -> Regions:
        """The regions of the cell; the matrix is one region, because discs do not touch."""
        arrangement, lines = self.arrangement, self.lines
        in_disc, in_ring = arrangement.within
        within = [(in_ring if ring else in_disc)[disc] for disc, ring in zip(lines.disc, lines.is_coating, strict=True)]
        # The phase number of voids follows all others; the last entry is the matrix.
        place = {name: number for number, name in enumerate((*arrangement.phases, phase_names.VOID))}
        phase = np.array([place[name] for name in (*within, arrangement.phases[0])])
        solid = phase < len(arrangement.phases)
        precedence = np.append(arrangement.precedence(lines.disc, lines.is_coating), 0)[solid]
        numbers, first, constituent = np.unique(precedence, return_index=True, return_inverse=True)
        of_circle = np.full(len(phase), -1)
        of_circle[solid] = constituent
        return Regions(
            width=self.scale * arrangement.width,
            height=self.scale * arrangement.height,
            scale=self.scale,
            origin=arrangement.origin,
            phases=arrangement.phases,
            ellipses=lines.ellipses.scaled(self.scale),
            constituent=of_circle,
            phase=phase[solid][first],
            precedence=numbers,
            nodes=len(lines.points),
        )
