"""Coarse spaces: the natural one of rigid-body motions, the adaptive one with soft modes (GenEO).

Imports `fem`, `feti`, `feti.decomposition`, `feti.linalg`, `feti.operators`, `mesh` and `system`.  Main entries:
`natural.NaturalCoarseSpace`, `adaptive.AdaptiveCoarseSpace` and `adaptive.Balanced`.
"""

__all__ = ["natural"]
