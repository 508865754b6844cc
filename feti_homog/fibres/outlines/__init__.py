"""Outlines of fibres: discs, ellipses, rounded polygons and other convex curves, and the rows of tables that have them.

Uses `typing` alone.  Main entries: `outlines.Outlines`, `shapes.SHAPES`.
"""
