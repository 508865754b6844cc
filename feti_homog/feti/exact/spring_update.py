"""Springs at the few nodes where both bodies are cut, which no single subdomain can include.

With the compliances C of the rows X, the preconditioner H, which is M^-1 or H_0, becomes

    H - H X (C^-1 + X^T H X)^-1 X^T H,

which is (H^-1 + X C X^T)^-1 where H is definite, as H_0 is on G^T lam = 0.  On the rows X this is

    C^-1 (C^-1 + X^T H X)^-1 X^T H,

in which no digits cancel, however soft the springs are.
"""

from collections.abc import Callable

import numpy as np
from mpi4py import MPI
from scipy.linalg import LinAlgError, cho_factor, cho_solve

from feti_homog.errors import ConvergenceError
from feti_homog.feti.operators.preconditioners import Preconditioner
from feti_homog.system.parallel import distributed_arrays, mpi_errors
from feti_homog.typing import Float


class SpringUpdate:
    """The update for the rows where `compliance` (owned rows,) is not 0."""

    def __init__(self, comm: MPI.Intracomm, first: int, compliance: Float, inverse: Callable[[Float], Float]) -> None:
        """Factor the update; `inverse` is r -> H r for r (owned rows, k), `first` the first owned row.  Collective.

        Raises:
            ConvergenceError: the springs are softer than the rounding of H.
        """
        self.comm, self.first = comm, first
        places = np.flatnonzero(compliance)
        self.rows = np.concatenate(comm.allgather(first + places))
        if not len(self.rows):
            return
        mine = (self.rows >= first) & (self.rows < first + len(compliance))
        unit = np.zeros((len(compliance), len(self.rows)))
        unit[places, np.flatnonzero(mine)] = 1.0
        self._columns = inverse(unit)
        stiffness = 1.0 / np.concatenate(comm.allgather(compliance[places]))
        block = distributed_arrays.gather_rows(comm, self._columns, first, self.rows)
        self._factor = mpi_errors.agree(comm, _factored, np.diag(stiffness) + (block + block.T) / 2)
        self._own, self._mine, self._stiffness = places, mine, stiffness[mine]

    def apply(self, z: Float) -> Float:
        """Update z = H r (owned rows,) or (owned rows, k) for the springs.  Collective."""
        if not len(self.rows):
            return z
        stretch = cho_solve(self._factor, distributed_arrays.gather_rows(self.comm, z, self.first, self.rows))
        updated = np.asarray(z - self._columns @ stretch)
        updated[self._own] = distributed_arrays.scale_rows(self._stiffness, stretch[self._mine])
        return updated


def _factored(block: Float) -> tuple[Float, bool]:
    """Factor C^-1 + X^T H X; raise ConvergenceError if it is not definite."""
    try:
        factor: tuple[Float, bool] = cho_factor(block)
    except LinAlgError as error:
        raise ConvergenceError(
            "[interface] springs too soft beside the pieces of cut fibres, rounding hides them: expected whole fibres, "
            "by fewer [decomposition] subdomains, or -feti_pc_type dirichlet"
        ) from error
    return factor


class SpringUpdated(Preconditioner):
    """A preconditioner that is updated for the springs of active rows, which may soften."""

    def __init__(self, comm: MPI.Intracomm, inner: Preconditioner, first: int, compliance: Float) -> None:
        """Update `inner`, which is H with all rows active; other arguments as of `SpringUpdate`.  Collective."""
        self._comm, self._inner, self._first = comm, inner, first
        self._left_out = self._compliance = compliance
        self.is_exact, self.norm = inner.is_exact, inner.norm  # softer springs make |H| smaller
        self._update = SpringUpdate(comm, first, compliance, inner.apply)

    def soften(self, more: Float) -> None:
        """Give springs `more` compliance (owned rows,) than at first, from the next `activate` on."""
        self._compliance = self._left_out + more

    def activate(self, active: Float) -> None:
        """Restrict to the rows where `active` is 1, and update.  Collective."""
        self._inner.activate(active)
        self._update = SpringUpdate(self._comm, self._first, active * self._compliance, self._inner.apply)

    def apply(self, r: Float) -> Float:
        """Compute the updated H times r.  Collective."""
        return self._update.apply(self._inner.apply(r))

    def closing_forces(self, jump: Float) -> Float:
        """Update the closing forces of `inner`.  Collective."""
        return self._update.apply(self._inner.closing_forces(jump))
