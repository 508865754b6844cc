"""Many cases from one file: expanded, run here or in a job array, collected into one table.

Imports `analysis`, `case`, `feti`, `homogenization`, `mesh`, `microstructure`, `report`, `results`, `schema`,
`studies.sweep.report` and `system`.  Main entries: `plan.load`, `execute.run_all` and `collect.collect`.
"""
