"""Preconditioners of the dual problem: none, lumped and Dirichlet, scaled by stiffness.

Imports `feti`, `feti.decomposition`, `feti.linalg`, `feti.operators` and `system`.  Main entries: `scaled`.
"""
