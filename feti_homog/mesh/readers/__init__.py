"""Meshes of users: gmsh, Abaqus and VTK files, their checks, and the curves that their interfaces follow.

Imports `case`, `fibres`, `mesh`, `mesh.tiles`, `runtime` and `schema`.  Main entry: `msh_reader.read`.
"""
