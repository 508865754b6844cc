"""Preconditioners of the dual problem: none, lumped and Dirichlet (scaled by stiffness), and influence columns.

Imports `feti`, `feti.decomposition`, `feti.linalg`, `feti.operators`, `parallel` and `runtime`.  Main entries:
`scaled` and `exact_inverse`.
"""
