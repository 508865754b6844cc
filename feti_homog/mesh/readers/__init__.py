"""Meshes of users: gmsh, Abaqus, VTK and Medit files, their checks, and the curves that their interfaces follow.

Imports `case`, `mesh`, `mesh.tiles`, `microstructure`, `schema` and `system`.  Main entry: `msh_reader.read`.
"""
