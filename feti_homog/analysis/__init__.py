"""Analyses on a torn cell: `run(context)` by [analysis] type.

Imports `case`, `feti`, `homogenization`, `interface`, `materials`, `mesh`, `microstructure`, `report`, `results`
and `system`.
Main entries: `runner.run` (with files) and `runner.compute` (without).
"""

__all__ = ["description", "result", "runner", "stored_result"]
