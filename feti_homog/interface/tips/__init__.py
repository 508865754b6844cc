"""Debonded arcs and their tips: where they lie, and the energy that they release.

May use `interface.contact`.  Main entries: `debonded_arcs` and `crack_tips`.
"""
