"""Lines of a cell and the nodes on them: sides, arcs of fibres, bridges between fibres.

Imports `mesh.sizes`, `microstructure` and `system`.  Main entries: `bare_outline` and `outline`.
"""

__all__ = ["lines", "outline"]
