"""Linear algebra of the FETI method beyond single library calls; PETSc, its libraries and LAPACK factor the matrices.

Imports `feti` and `system`.  Main entries: `sparse_direct.DirectSolver`, `sparse_matrices.DistributedSolver`, and
the sums over ranks in `sparse_matrices`.
"""
