"""Macroscopic loads: strains, stresses and temperature, and the strains that follow from given stresses.

May use `feti`.  Main entries: `load.Load` and `mixed_load`.
"""
