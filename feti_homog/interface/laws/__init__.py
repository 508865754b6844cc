"""Laws of the interface: which bond breaks at which traction or energy.

May use `interface.tips`.  Main entry: `bond_criterion.BondCriterion`.
"""
