"""Linear algebra that the FETI method needs and no library has in one call; factorizations are PETSc's.

May use `thresholds`, `parallel` and `petsc`.  Main entries: `sparse_direct.DirectSolver`,
`distributed_solver.RenewedSolver`, by
`tree_elimination.TreeElimination` unless options ask for PETSc's, and the sums over ranks in `collectives` and
`distributed_matrix`.
"""
