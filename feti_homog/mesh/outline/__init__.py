"""Lines of a cell and the nodes on them: sides, arcs of fibres, bridges between fibres.

Imports `fibres`, `mesh.sizes` and `parallel`.  Main entries: `bare_outline` and `outline`.
"""
