"""Preconditioners of the dual problem: none, lumped and Dirichlet (scaled by stiffness), and influence columns.

May use `operators`, `decomposition` and `linalg`.  Main entries: `scaled` and `influence`.
"""
