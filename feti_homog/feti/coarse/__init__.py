"""The natural coarse space of rigid-body motions, and the adaptive coarse space with soft modes (GenEO).

Imports `fem`, `feti`, `feti.decomposition`, `feti.linalg`, `feti.operators`, `mesh` and `system`.  Main entries:
`natural.NaturalCoarseSpace`, `adaptive.AdaptiveCoarseSpace` and `adaptive.Balanced`.
"""

__all__ = ["natural"]
