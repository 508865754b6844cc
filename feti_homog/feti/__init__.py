"""The dual problem of the torn cell: subdomains, multipliers, dual operator, coarse spaces, preconditioners, solver.

Imports `fem`, `feti.coarse`, `feti.decomposition`, `feti.exact`, `feti.linalg`, `feti.operators`, `mesh` and `system`.
Main entry: `solver.FetiSolver`. Its own floors, each on the floors below:

    solver, factory, solver_plan, krylov, dual_solution, confirmation
    coarse           natural and adaptive coarse space, the preconditioner with the latter
    exact            exact inverses of F from influence columns
    operators        S and S+ of subdomains, the dual operator F, preconditioners without coarse space
    decomposition    subdomains, kernels, the jump operator B
    linalg           factorizations and matrices on one rank and on all
    thresholds       every tuning constant, with the command that measured it
"""

from feti_homog.feti.dual_solution import DualSolution
from feti_homog.feti.solver import FetiSolver

__all__ = ["DualSolution", "FetiSolver", "factory", "solver_plan", "thresholds"]
