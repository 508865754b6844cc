"""The whole coarse mesh of a case, also of one that the program tears tile by tile."""

from feti_homog.homogenization.tile_tearing import fill_tiles, place_nodes
from feti_homog.mesh.tiles.tiling import DEFAULT_TILES


def coarse_mesh(case, comm, policy=DEFAULT_TILES):
    """Gather the mesh on rank 0, filled by all; None on other ranks.  Collective."""
    return fill_tiles(place_nodes(case, comm, policy), comm)
