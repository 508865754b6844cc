"""Materials: their constants, laws and bounds, Voigt's notation, closed formulas of the mechanics of composites.

Imports `schema` and `system`.  Main entries: `forms`, `laws`, `constants`, `bounds`, `estimates`.
"""
