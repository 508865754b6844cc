"""Follow load paths from event to event or in equal steps, and find the onsets of breaks.

Imports `feti`, `interface`, `interface.contact`, `interface.friction`, `interface.laws` and `system`.  Main entry:
`path_following`.
"""

__all__ = ["coulomb_leg", "frictionless_leg", "onsets", "path_following", "path_points"]
