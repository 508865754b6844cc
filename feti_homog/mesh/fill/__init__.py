"""Generate a coarse mesh from an arrangement of fibres, or from an image.

Imports `case`, `mesh`, `mesh.outline`, `mesh.readers`, `mesh.tiles` and `microstructure`.  Main entries:
`gmsh_mesher.begin` and `gmsh_mesher.NodedCell`.
"""

__all__ = ["element_estimate", "gmsh_mesher", "pixel_mesher"]
