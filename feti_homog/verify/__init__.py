"""Certify a result: check all laws that the result must obey, from its files alone.

Imports `case` and `system`.  The package has its own reader, elements and torus, so that a defect of the solver cannot
hide itself; it uses neither MPI nor PETSc.  Main entry: `certificate.verify`, which `feti-homog verify DIR` prints.
"""

__all__ = ["certificate", "constitutive_law"]
