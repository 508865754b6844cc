"""Analyse a torn cell: one module with `run(context)` for each [analysis] type, and the `Result` of a case.

Imports `case`, `feti`, `homogenization`, `interface`, `materials`, `mesh`, `microstructure`, `report`, `results`,
`schema` and `system`.  Main entries: `runner.run` (with files) and `runner.compute` (without).
"""

__all__ = ["description", "result", "runner", "stepped_progress", "stored_result"]
