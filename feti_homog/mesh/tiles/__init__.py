"""Tiles of a large cell: how it is divided, filled by gmsh, and joined on the torus.

Imports `fibres`, `mesh`, `mesh.outline` and `mesh.sizes`.  Main entries: `tiles.TilePolicy` and `filling.fill`.
"""
