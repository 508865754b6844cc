"""Coulomb friction on debonded faces.

Imports `feti`, `interface`, `interface.contact` and `system`.  Main entries: `coulomb_faces`, `sliding_cell`.
"""

__all__ = ["coulomb_faces", "sliding_cell"]
