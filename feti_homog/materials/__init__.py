"""Materials: their constants, laws and bounds, Voigt's notation, closed formulas of the mechanics of composites.

May use `schema`, `runtime` and `errors`.  Main entries: `forms`, `laws`, `bounds`, `spatial_constants`,
`estimates.methods`.
"""
