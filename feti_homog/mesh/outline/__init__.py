"""Build the lines of a cell, with edge sizes and nodes: cell sides, fibre arcs, and bridges between fibres.

Imports `case`, `microstructure` and `system`.  Main entries: `bare_outline` and `outline`.
"""

__all__ = ["graded_size", "lines", "outline"]
