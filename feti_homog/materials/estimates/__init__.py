"""Closed estimates of the constants of a unidirectional composite, from its phases and their fractions alone.

Imports `materials` and `runtime`.  Main entries: `methods.estimates` and `fibre_bounds.fibre_bounds`.
"""
