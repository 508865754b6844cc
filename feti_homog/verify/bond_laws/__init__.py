"""Laws of bonds by formulas of their own, to check results by; a module for each of `interface/laws`.

May use `case.bond_laws`.  Main entry: `law.law_of`.
"""
