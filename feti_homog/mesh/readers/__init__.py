"""Read users' meshes (gmsh, Abaqus, VTK and Medit files), check the meshes, and bend edges at interfaces.

Imports `mesh`, `mesh.tiles`, `microstructure`, `schema` and `system`.  Main entry: `msh_reader.read`.
"""

__all__ = ["msh_reader"]
