"""From a case to the torn cell on its ranks, and from its solutions to macroscopic averages.

Imports `case`, `fem`, `feti`, `interface`, `materials`, `mesh`, `microstructure`, `schema` and `system`.  Main entries:
`unit_cell.tear` and `averaging.Homogenization`.
"""
