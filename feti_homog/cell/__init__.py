"""The periodic cell: arrangement of fibres, coarse mesh by gmsh or from a file, refinement, torus."""
