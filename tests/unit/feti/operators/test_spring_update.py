"""Springs added to an inverse, against the inverse of the sum."""

import numpy as np
import pytest
from mpi4py import MPI

from feti_homog.errors import ConvergenceError
from feti_homog.feti.operators.preconditioners import SpringUpdate


@pytest.mark.parametrize("softness", [1e-12, 1.0, 1e6, 1e15, 1e25])
def test_the_inverse_with_springs_is_exact_row_by_row(softness):
    """Also where the springs are so soft that nothing of H is left on their rows."""
    rng = np.random.default_rng(3)
    half, compliance = rng.standard_normal((7, 7)), np.zeros(7)
    H, compliance[[1, 2, 5]] = half @ half.T + np.eye(7), softness * np.array([1.0, 3.0, 0.2])
    update = SpringUpdate(MPI.COMM_SELF, 0, compliance, lambda r: H @ r)
    size = np.sqrt(1.0 + compliance)
    flexibility = (np.linalg.inv(H) + np.diag(compliance)) / np.outer(size, size)
    expected = np.linalg.inv(flexibility) / np.outer(size, size)
    off = np.abs(update.apply(H) - expected).max(axis=1)
    assert (off < 1e-12 * np.abs(expected).max(axis=1)).all()


def test_springs_beside_what_is_not_definite_are_refused():
    with pytest.raises(ConvergenceError, match="springs too soft beside the pieces of cut fibres"):
        SpringUpdate(MPI.COMM_SELF, 0, np.array([1e20, 1.0]), lambda r: np.array([[-1e-12, 0.0], [0.0, 1.0]]) @ r)
