"""Analyses of a torn cell, a module each, found by `registry`; `context` has what they share.

Imports `case`, `feti`, `homogenization`, `interface`, `materials`, `microstructure`, `report`, `results` and `system`.
Main entries: `runner.run` (with files) and `runner.compute` (without).
"""
