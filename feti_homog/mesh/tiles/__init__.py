"""The tiles of a large cell: division, filling by gmsh, and union on the torus.

Imports `mesh`, `mesh.outline` and `microstructure`.  Main entries: `tiling.TilePolicy` and
`tile_filling.fill`.
"""

__all__ = ["tile_filling", "tiling"]
