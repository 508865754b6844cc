"""Materials: their constants, laws and bounds, Voigt's notation, closed formulas of the mechanics of composites.

Imports `runtime` and `schema`.  Main entries: `forms`, `laws`, `bounds`, `spatial_constants`, `estimates.methods`.
"""
