"""Exact inverses of the dual operator: from influence columns, or from a factored bonded cell.

Imports `feti`, `feti.decomposition`, `feti.linalg`, `feti.operators` and `system`.  Main entries:
`exact_inverse.ExactInverse` and `reference_cell.BondedInverse`.
"""

__all__ = ["exact_inverse"]
