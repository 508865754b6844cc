"""Bond laws: breaks by tractions or energies, and their consequences.

Imports `case`, `feti` and `interface.contact`.  Main entries: `bond_law.BondLaw`, `bond_law.law_class`.
"""
