"""Many cases from one file: expanded, run here or in a job array, collected into one table.

Imports `analysis`, `case`, `feti`, `homogenization`, `mesh`, `parallel`, `petsc`, `report`, `results`, `runtime`,
`schema` and `sweep.report`.  Main entries: `plan.load`, `execute.run_all` and `collect.collect`.
"""
