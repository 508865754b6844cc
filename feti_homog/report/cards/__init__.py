"""Effective constants as material cards of other programs: Abaqus, CalculiX, ANSYS, MOOSE, and as a table.

May use `results` and `report.text`.  Main entry: `export.card`.
"""
