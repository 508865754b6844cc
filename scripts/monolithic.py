"""The peer of the benchmarks: one stiffness matrix of the whole periodic cell, factored by CHOLMOD through PETSc."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from glued import Nodes
from petsc4py import PETSc
from scipy.sparse import csr_matrix

from feti_homog.feti.linalg.sparse_direct import DirectSolver
from feti_homog.homogenization.unit_cell import TornCell


def glued(cell: TornCell) -> tuple[csr_matrix, np.ndarray]:
    """Return K and Q of the perfectly bonded cell, with subdomains (all on one rank) glued on the torus."""
    local = Nodes.of(cell.comm, cell.subdomains, cell.lattice).local
    dofs = (2 * np.concatenate(local)[:, None] + np.arange(2)).ravel()
    n, first = int(dofs.max()) + 1, 0
    K, Q = csr_matrix((n, n)), np.zeros((n, 3))
    for s in cell.subdomains:
        own = dofs[first : first + len(s.Q)]
        gather = csr_matrix((np.ones(len(own)), (own, np.arange(len(own)))), shape=(n, len(own)))
        K, Q, first = K + gather @ s.assemble_stiffness() @ gather.T, Q + gather @ s.Q, first + len(own)
    K = K.tocsr()
    # The solver sorts the columns that it shares with K, but not K's numbers.
    K.sort_indices()
    return K, Q


def factor_and_solve(
    K: csr_matrix, loads: np.ndarray, clock: Callable[[], float] = time.perf_counter
) -> tuple[float, float]:
    """Return the seconds to factor K and to solve for the columns of `loads` (n, k)."""
    start = clock()
    solver = DirectSolver(K, "mono_")
    factored = clock()
    for load in loads.T:
        solver.solve(load)
    done = clock()
    PETSc.garbage_cleanup(PETSc.COMM_SELF)
    return factored - start, done - factored
