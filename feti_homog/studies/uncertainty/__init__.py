"""Scatter of results by the scatter of inputs.

Imports `case`, `report`, `results`, `schema`, `studies.fit`, `studies.sweep` and `system`.  Main entries: `scatter` and
`scatter_table`.
"""
