"""From a case to the torn cell on its ranks, and from its solutions to macroscopic averages.

Imports `case`, `fem`, `feti`, `fibres`, `interface`, `materials`, `mesh`, `parallel`, `petsc`, `runtime` and `schema`.
Main entries: `unit_cell.tear` and `averaging.Homogenization`.
"""
