"""A certificate of results: every law that they must obey, checked anew from the files alone.

Imports `system` and `verify.bond_laws`. Has its own reader, elements and torus, so that a defect of the solver cannot
hide itself; uses neither MPI nor PETSc.  Main entry: `certificate.verify`, what `feti-homog verify DIR` prints.
"""
