"""The coarse periodic mesh, its topology on the torus, submeshes and their refinement.

Imports `case` and `microstructure`.  Main entries: `fill.gmsh_mesher.begin`, `readers.msh_reader.read`,
`periodic_topology.Torus` and `refinement.refine`. gmsh is loaded where there is something to fill.
"""
