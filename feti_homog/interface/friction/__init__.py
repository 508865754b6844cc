"""Coulomb friction on debonded faces.

Imports `feti`, `interface.contact`, `interface.loads` and `system`.  Main entries: `coulomb_faces` (dense arrays alone)
and `sliding_cell`.
"""
