"""Constants of cases fitted to what was measured.

Imports `case`, `materials`, `parallel`, `report`, `results`, `runtime`, `schema`, `sweep`.  Main entries:
`description.load` and `execute.run`.
"""
