"""Generated cells: from an arrangement of fibres to a coarse mesh.

May use `mesh.readers`.  Main entries: `gmsh_mesher.begin` and `drawing`.
"""
