"""Preconditioners of the dual problem: none, lumped and Dirichlet (scaled by stiffness), and exact inverses.

Imports `feti`, `feti.decomposition`, `feti.linalg`, `feti.operators`, `parallel` and `runtime`.  Main entries:
`scaled`, `exact_inverse` and `bonded_inverse`.
"""
