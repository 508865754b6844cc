"""The factor of an assembled Schur complement: dense where it is full, by the library that options name."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI
from scipy.sparse import csr_matrix, identity

from feti_homog.feti.linalg.dense_matrices import DenseSolver
from feti_homog.feti.linalg.sparse_direct import DirectSolver
from feti_homog.feti.preconditioners.assembled_schur import AssembledSchur, block_sum
from feti_homog.system.petsc.options import case_options


@pytest.mark.parametrize(
    ("full", "options", "kind"),
    [
        (True, {}, DenseSolver),
        (True, {"feti_bonded_pc_factor_mat_solver_type": "mumps"}, DirectSolver),
        (False, {}, DirectSolver),
    ],
)
def test_full_sums_without_options_are_factored_as_dense_ones(full, options, kind):
    rng, S = np.random.default_rng(0), np.zeros((20, 20))
    blocks = [np.arange(20)] * 2 if full else np.arange(20).reshape(10, 2)
    with case_options(options):
        found = block_sum(MPI.COMM_SELF, 20, [len(rows) for rows in blocks])
        for rows in blocks:
            half = rng.normal(size=(len(rows), len(rows)))
            block = half @ half.T + np.eye(len(rows))
            found.add(rows, rows, block)
            S[np.ix_(rows, rows)] += block
        total = found.of_all_ranks(MPI.COMM_SELF) if full and not options else found.matrix()
        own = AssembledSchur(MPI.COMM_SELF, csr_matrix(identity(20)), total)
    assert type(own._solver) is kind
    forces = rng.normal(size=(20, 3))
    np.testing.assert_allclose(own.relieving_displacement(forces), -np.linalg.solve(S, forces), rtol=1e-9, atol=1e-12)
    own.destroy()
