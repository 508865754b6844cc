"""Linear algebra that the FETI method needs and no library has in one call; factorizations are PETSc's.

Imports `feti` and `system`.  Main entries: `sparse_direct.DirectSolver`, `distributed_solver.DistributedSolver`, and
the sums over ranks in `sparse_matrices`.
"""
