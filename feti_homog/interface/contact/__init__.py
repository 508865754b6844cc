"""Open and closed nodes of debonded interfaces at one load.

Imports `feti`, `interface`, `materials`, `mesh` and `system`.  Main entry: `contact_problem.ContactProblem`.
"""
