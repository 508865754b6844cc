"""Tiles of a large cell: how it is divided, filled by gmsh, and joined on the torus.

Imports `mesh`, `mesh.outline`, `mesh.sizes` and `microstructure`.  Main entries: `tiles.TilePolicy` and `filling.fill`.
"""
