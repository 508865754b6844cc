"""Constants of cases fitted to what was measured.

Imports `case`, `materials`, `microstructure`, `report`, `results`, `schema`, `studies.sweep`, `studies.sweep.report`
and `system`.  Main entries: `description.load` and `execute.run`.
"""
