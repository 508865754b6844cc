"""Generated cells: from an arrangement of fibres to a coarse mesh.

Imports `case`, `fibres`, `mesh`, `mesh.outline`, `mesh.readers`, `mesh.sizes` and `mesh.tiles`.  Main entries:
`gmsh_mesher.begin` and `gmsh_mesher.NodedCell`.
"""
