"""The factor of an assembled Schur complement: dense where it is full, by the library that options name."""

import numpy as np
import pytest
from mpi4py import MPI
from support import torn_cells

from feti_homog.feti.linalg.dense_matrices import DenseSolver
from feti_homog.feti.linalg.sparse_direct import DirectSolver

CUT = {"geometry": "random", "fibres": 5, "fibre_fraction": 0.3, "min_gap": 0.1, "decomposition": {"subdomains": 24}}


@pytest.mark.parametrize(
    ("case", "options", "kind"),
    [
        ({"geometry": "square"}, {}, DenseSolver),
        ({"geometry": "square"}, {"feti_bonded_pc_factor_mat_solver_type": "mumps"}, DirectSolver),
        (CUT, {}, DirectSolver),
    ],
)
def test_full_sums_without_options_are_factored_as_dense_ones(case, options, kind):
    solver = torn_cells.tear(MPI.COMM_SELF, **case, petsc={"feti_pc_type": "influence"} | options).solver
    assembled, operators = solver.exact_inverse.reference.assembled, solver.interface_operators
    assert type(assembled._solver) is kind
    Z = assembled._Z.toarray()
    forces = np.random.default_rng(0).normal(size=(len(Z), 3))
    expected = -Z @ np.linalg.solve(Z.T @ operators.apply_with_springs(Z), Z.T @ forces)
    np.testing.assert_allclose(assembled.relieving_displacement(forces), expected, atol=1e-9 * np.abs(expected).max())
    # Copies of a node move together.
    assert np.abs(operators.B @ Z).max() < 1e-14
