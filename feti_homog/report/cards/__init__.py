"""Write effective constants as material cards for Abaqus, CalculiX, ANSYS and MOOSE, or as a table.

Imports `materials`, `report.text` and `results`.  Main entry: `export.card`.
"""

__all__ = ["export"]
