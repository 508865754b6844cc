"""Analyses on a torn cell: `run(context)` in the module that [analysis] type names, with one context.

Imports `case`, `feti`, `homogenization`, `interface`, `materials`, `microstructure`, `report`, `results` and `system`.
Main entries: `runner.run` (with files) and `runner.compute` (without).
"""
