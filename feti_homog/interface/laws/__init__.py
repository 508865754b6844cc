"""Bond laws: the tractions or energies at which bonds break, and the consequences of a break.

Imports `case`, `feti` and `interface.contact`.  Main entries: `bond_law.BondLaw`, `bond_law.law_of_sections`.
"""

from feti_homog.interface.laws.bond_law import UTILISATION_TIE, BondLaw, law_of_sections

__all__ = ["UTILISATION_TIE", "BondLaw", "energy", "law_of_sections"]
