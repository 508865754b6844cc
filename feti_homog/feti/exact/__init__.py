"""Exact inverses of the dual operator from influence columns.

Imports `feti`, `feti.decomposition`, `feti.linalg`, `feti.operators`, `feti.preconditioners` and `system`.  Main
entries: `exact_inverse` and `bonded_inverse`.
"""
