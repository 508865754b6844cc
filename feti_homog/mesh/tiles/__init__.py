"""Tiles of a large cell: how it is divided, filled by gmsh, and joined on the torus.

May use `mesh.outline`.  Main entries: `tiles.TilePolicy` and `filling.fill`.
"""
