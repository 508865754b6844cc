"""Readers of users' meshes (gmsh, Abaqus, VTK and Medit files), mesh checks, and curves along interfaces.

Imports `mesh`, `mesh.tiles`, `microstructure`, `schema` and `system`.  Main entry: `msh_reader.read`.
"""

__all__ = ["msh_reader"]
