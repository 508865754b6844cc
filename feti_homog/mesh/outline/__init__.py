"""Lines of a cell and the nodes on them: sides, arcs of fibres, bridges between fibres.

May use `mesh.sizes`.  Main entries: `bare_outline` and `outline`.
"""
