"""Coulomb friction on debonded faces.

Imports `feti` and `interface.contact`.  Main entries: `coulomb_faces` (dense arrays alone) and `sliding_cell`.
"""
