"""Preconditioners of the dual problem: none, lumped and Dirichlet (scaled by stiffness), and influence columns.

Imports `feti`, `feti.decomposition`, `feti.linalg`, `feti.operators` and `parallel`.  Main entries: `scaled` and
`exact_inverse`.
"""
