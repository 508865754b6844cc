"""Closed formulas of the mechanics of composites: moduli and bounds.

May use `errors` alone.  Main entry: `bounds`.
"""
