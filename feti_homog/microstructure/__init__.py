"""Spatial statistics of fibres in a cross-section, of a periodic cell or of a window of a micrograph: pure functions.

Imports nothing.  Main entries: `statistics.measure`, `statistics.envelope` and `neighbour_match`.
"""
