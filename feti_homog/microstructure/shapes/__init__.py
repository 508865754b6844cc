"""Outlines of fibres: discs, ellipses, rounded polygons and other convex curves, and the table rows that have them.

Imports nothing.  Main entries: `outlines.Outlines`, `shapes.SHAPES`.
"""
