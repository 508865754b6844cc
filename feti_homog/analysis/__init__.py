"""Analyses of a torn cell: `run(context)` of the module named by [analysis] type, with one context.

Imports `case`, `feti`, `homogenization`, `interface`, `materials`, `microstructure`, `report`, `results` and `system`.
Main entries: `runner.run` (with files) and `runner.compute` (without).
"""
