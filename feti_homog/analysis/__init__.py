"""Analyses of a torn cell, a module each, found by `registry`; `context` has what they share.

Imports `case`, `feti`, `fibres`, `homogenization`, `interface`, `materials`, `parallel`, `petsc`, `report`, `results`
and `runtime`.  Main entries: `runner.run` (with files) and `runner.compute` (without).
"""
