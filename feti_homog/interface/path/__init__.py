"""Load paths: from event to event, onsets of breaks, and later legs.

Imports `feti`, `interface`, `interface.contact`, `interface.friction`, `interface.laws` and `system`.  Main entry:
`path_following`.
"""

__all__ = ["coulomb_leg", "frictionless_leg", "onsets", "path_following", "path_points"]
