"""Tiles of a large cell: how it is divided, filled by gmsh, and joined on the torus.

Imports `mesh`, `mesh.outline`, `mesh.sizes` and `microstructure`.  Main entries: `tiling.TilePolicy` and
`tile_filling.fill`.
"""

__all__ = ["tile_filling", "tiling"]
