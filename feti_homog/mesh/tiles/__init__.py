"""Divide a large cell into tiles, fill the tiles by gmsh, and join the tiles on the torus.

Imports `mesh`, `mesh.outline` and `microstructure`.  Main entries: `tiling.TilePolicy` and
`tile_filling.fill`.
"""

__all__ = ["tile_filling", "tiling"]
