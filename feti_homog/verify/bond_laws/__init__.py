"""Laws of bonds by independent formulas, a module for each of `interface/laws`.

Imports `case`.  Main entry: `law.law_of`.
"""
