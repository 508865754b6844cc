"""A certificate of results: every law that they must obey, checked anew from the files alone.

Imports `case` and `system`. Has its own reader, elements and torus, so that a solver defect cannot hide itself; uses
neither MPI nor PETSc.  Main entry: `certificate.verify`, which `feti-homog verify DIR` prints.
"""

__all__ = ["certificate", "constitutive_law"]
