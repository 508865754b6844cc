"""Operators on the boundaries of subdomains, S and S+, explicit or implicit, and the dual operator F made of them.

Imports `feti`, `feti.decomposition`, `feti.linalg` and `system`.  Main entries: `choice.choose`,
`interface_operators.InterfaceOperators` and `interface_operators.DualOperator`.
"""
