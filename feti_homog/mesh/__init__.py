"""Build the coarse periodic mesh, its topology on the torus, submeshes and their refinement.

Imports `case`, `microstructure` and `schema`.  Main entries: `fill.gmsh_mesher.begin`, `readers.msh_reader.read`,
`periodic_topology.Torus` and `refinement.refine`. Only gmsh sessions import the module gmsh.
"""

from feti_homog.mesh.coarse_mesh import CoarseMesh
from feti_homog.mesh.periodic_topology import Torus
from feti_homog.mesh.refinement import FineMesh, ReferenceLattice
from feti_homog.mesh.submeshes import Submesh, SubmeshesOfRank

__all__ = [
    "CoarseMesh", "FineMesh", "ReferenceLattice", "Submesh", "SubmeshesOfRank", "Torus", "arrange", "coarse_mesh",
    "mesh_fibres", "periodic_topology", "refinement", "submeshes",
]  # fmt: skip
