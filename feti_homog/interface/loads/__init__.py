"""Macroscopic loads: strains, stresses and temperature, and the strains that follow from given stresses.

Imports `feti` and `system`.  Main entries: `load.Load` and `mixed_load`.
"""
