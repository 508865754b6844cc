"""The periodic cell: arrangement of the fibres, coarse mesh by gmsh or from a file, refinement, identity on the torus."""
