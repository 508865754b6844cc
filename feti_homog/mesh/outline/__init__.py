"""The cell lines, with nodes: sides, fibre arcs, and bridges between fibres.

Imports `mesh.sizes`, `microstructure` and `system`.  Main entries: `bare_outline` and `outline`.
"""

__all__ = ["lines", "outline"]
