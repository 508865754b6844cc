"""Debonded arcs and their tips: where they lie, and the energy that they release.

Imports `case`, `interface.contact` and `schema`.  Main entry: `debonded_arcs`.
"""
