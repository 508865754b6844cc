"""Laws of bonds: which bond breaks at which traction or energy, and what follows.

Imports `case`, `feti` and `interface.contact`.  Main entries: `bond_law.BondLaw`, `bond_law.law_class`.
"""
