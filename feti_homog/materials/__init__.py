"""Closed formulas of the mechanics of composites: moduli, bounds, Voigt's notation.

May use `case`, `runtime` and `errors`.  Main entries: `bounds`, `spatial_constants`, `estimates.methods`.
"""
