"""Closed estimates of the constants of a unidirectional composite, from its phases and their fractions alone.

Imports `materials` and `system`.  Main entries: `methods.estimates` and `methods.fibre_bounds`.
"""
