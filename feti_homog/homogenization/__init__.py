"""From case to torn cell, and from its solutions to averages.

Imports `case`, `fem`, `feti`, `interface`, `materials`, `mesh`, `microstructure`, `schema` and `system`.  Main entries:
`unit_cell.tear` and `averaging.Homogenization`.
"""
