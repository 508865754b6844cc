"""The dual problem of the torn cell: subdomains, multipliers, dual operator, coarse spaces, preconditioners, solver.

May use `fem`, `mesh`, `parallel` and `petsc`.  Main entry: `solver.FetiSolver`.  Its own floors, each on those below:

    solver, view, factory, solver_plan, krylov
    coarse           natural and adaptive coarse space, the preconditioner with the latter, projector
    preconditioners  lumped, Dirichlet, influence columns
    operators        S and S+ of subdomains, the dual operator F
    decomposition    subdomains, kernels, the jump operator B
    linalg           factorizations and matrices on one rank and on all
    thresholds       every tuning constant, with the command that measured it
"""
