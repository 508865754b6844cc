"""The dual problem of the torn cell, from subdomains and multipliers to the projected Krylov solver.

Imports `fem`, `feti.coarse`, `feti.decomposition`, `feti.exact`, `feti.linalg`, `feti.operators`, `mesh` and `system`.
Main entry: `solver.FetiSolver`.  Floors of the package, the highest first; a floor imports only floors below it:

    solver, solver_plan, krylov, dual_solution, confirmation
    coarse           natural coarse space; adaptive coarse space and its preconditioner
    exact            exact inverses of F from influence columns
    operators        S and S+ of subdomains, the dual operator F, preconditioners without a coarse space
    decomposition    subdomains, kernels, the jump operator B
    linalg           factorizations and matrices, local or distributed
    thresholds       all tuned constants, with the command that measured each constant
"""

from feti_homog.feti.dual_solution import DualSolution
from feti_homog.feti.solver import FetiSolver

__all__ = ["DualSolution", "FetiSolver", "solver_plan", "thresholds"]
