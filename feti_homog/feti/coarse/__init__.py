"""Coarse spaces: rigid-body motions (natural) and soft modes of the subdomains beside them (adaptive, GenEO).

Imports `fem`, `feti`, `feti.decomposition`, `feti.linalg`, `feti.operators`, `mesh` and `system`.  Main entries:
`natural.NaturalCoarseSpace`, `adaptive.AdaptiveCoarseSpace` and `adaptive.Balanced`.
"""

__all__ = ["natural"]
