"""The factor of an assembled Schur complement: dense where it is full, by the library that options name."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI
from scipy.sparse import csr_matrix, identity

from feti_homog.feti.linalg.dense_matrices import DenseSolver
from feti_homog.feti.linalg.sparse_direct import DirectSolver
from feti_homog.feti.preconditioners.assembled_schur import AssembledSchur
from feti_homog.petsc.options import case_options


@pytest.mark.parametrize(
    ("full", "options", "kind"),
    [
        (True, {}, DenseSolver),
        (True, {"feti_bonded_pc_factor_mat_solver_type": "mumps"}, DirectSolver),
        (False, {}, DirectSolver),
    ],
)
def test_full_matrices_without_options_are_factored_as_dense_ones(full, options, kind):
    half = np.random.default_rng(0).normal(size=(20, 20))
    S = half @ half.T + np.eye(20) if full else np.diag(np.arange(1.0, 21.0))
    with case_options(options):
        own = AssembledSchur(MPI.COMM_SELF, csr_matrix(identity(20)), csr_matrix(S))
    assert type(own._solver) is kind
    forces = np.random.default_rng(1).normal(size=(20, 3))
    np.testing.assert_allclose(own.relieving_displacement(forces), -np.linalg.solve(S, forces), rtol=1e-9, atol=1e-12)
    own.destroy()
