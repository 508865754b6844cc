"""From a case to the torn cell on its ranks, and from its solutions to macroscopic averages.

May use `interface`, `feti` and all floors below them.  Main entries: `unit_cell.tear` and `averaging.Homogenization`.
"""
