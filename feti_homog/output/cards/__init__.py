"""Effective constants as material cards of other programs: Abaqus, CalculiX, ANSYS, MOOSE, and as a table.

May use `output.files` and the floors below `output`.  Main entry: `export.card`.
"""
