"""Schur complements S and flexibilities S+ of subdomains, the dual operator F, and its preconditioners.

Imports `feti`, `feti.decomposition`, `feti.linalg` and `system`.  Main entries: `interface_operators.choose`,
`interface_operators.InterfaceOperators`, `interface_operators.DualOperator` and `preconditioners.Preconditioner`.
"""

__all__ = ["interface_operators", "one_subdomain"]
