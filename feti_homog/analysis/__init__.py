"""Analyses of a torn cell, a module each, found by `context.analysis_of`, with one context.

Imports `case`, `feti`, `homogenization`, `interface`, `materials`, `microstructure`, `report`, `results` and `system`.
Main entries: `runner.run` (with files) and `runner.compute` (without).
"""
