"""Meshes of users: gmsh, Abaqus and VTK files, their checks, and the curves that their interfaces follow.

May use `mesh.tiles`.  Main entry: `msh_reader.read`.
"""
