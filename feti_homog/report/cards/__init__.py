"""Effective constants as material cards of other programs: Abaqus, CalculiX, ANSYS, MOOSE, and as a table.

Imports `materials`, `report.text` and `results`.  Main entry: `export.card`.
"""

__all__ = ["export"]
