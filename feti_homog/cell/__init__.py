"""The periodic cell: fibres, its coarse mesh (by gmsh or from a file), its topology on the torus, and refinement.

May use `config`, `common` and `errors`.  Main entries: `gmsh_mesher.begin` and `filling.fill`, `msh_reader.read`,
`periodic_topology.Torus` and `refinement.refine`.  gmsh is loaded where there is something to fill.
"""
