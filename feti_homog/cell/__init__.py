"""The periodic cell: fibres, its coarse mesh (by gmsh or from a file), its topology on the torus, and refinement.

May use `config`, `common` and `errors`.  Main entries: `gmsh_mesher.generate`, `msh_reader.read`,
`periodic_topology.Torus` and `refinement.refine`.  gmsh is loaded on rank 0 alone.
"""
