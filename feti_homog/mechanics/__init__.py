"""Closed formulas of the mechanics of composites: moduli, bounds, Voigt's notation, numbers of stress-strain paths.

May use `config`, `common` and `errors`.  Main entries: `bounds`, `spatial_constants`, `estimates.methods`,
`response`.
"""
