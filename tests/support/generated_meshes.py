"""Generated cells, meshed on this rank."""

from feti_homog.mesh.arrange import arrange
from feti_homog.mesh.coarse_mesh import CoarseMesh
from feti_homog.mesh.fill.gmsh_mesher import NodedCell, UnmeshedCell, begin
from feti_homog.mesh.outline.bare_outline import BareOutline
from feti_homog.mesh.outline.graded_size import MeshSizes
from feti_homog.mesh.tiles.tile_filling import fill
from feti_homog.mesh.tiles.tiling import DEFAULT_TILES


def generate(cell, marks=None, policy=DEFAULT_TILES) -> CoarseMesh:
    """Mesh a generated cell."""
    begun = begin(cell, None if cell.table is None else arrange(cell), marks or {}, policy)
    return begun if isinstance(begun, CoarseMesh) else filled(noded(begun))


def mesh_of_discs(discs) -> CoarseMesh:
    """Mesh an arrangement of discs with elements of the size 0.1."""
    sizes = MeshSizes(0.1, 0.1, 0.1)
    return filled(noded(UnmeshedCell(discs, BareOutline.of(discs, sizes, {}), sizes, None, 1.0)))


def noded(cell: UnmeshedCell) -> NodedCell:
    """Place the nodes of all lines."""
    return cell.with_nodes(cell.bare.lines.stations(cell.bare.field))


def filled(cell: NodedCell) -> CoarseMesh:
    """Fill all tiles."""
    return cell.mesh([fill(tile) for tile in cell.parts])
