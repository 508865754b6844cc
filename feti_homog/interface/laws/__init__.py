"""Laws of bonds: which bond breaks at which traction or energy, and what follows.

May use `interface.tips`.  Main entries: `bond_law.BondLaw`, `registry.law_class`.
"""
