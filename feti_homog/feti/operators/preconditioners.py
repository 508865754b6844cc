"""Preconditioners of the dual problem: none, lumped, Dirichlet; and their update for springs.

M^-1 = W^-1 B D^-1 S D^-1 B^T W^-1 on the active rows, with W = B D^-1 B^T and the mean diagonal stiffness D of every
node.  W is block-diagonal by node.  S is the boundary block of K (lumped), or its Schur complement (Dirichlet).

Springs at the few nodes where both bodies are cut belong to no subdomain.  Let X be the unit vectors of their rows and
C their compliances.  The preconditioner H, which is M^-1 or H_0 (`coarse.adaptive`), then becomes

    H - H X (C^-1 + X^T H X)^-1 X^T H.

Where H is definite, as H_0 is on G^T lam = 0, the result is (H^-1 + X C X^T)^-1.  Its rows at the springs are

    C^-1 (C^-1 + X^T H X)^-1 X^T H,

where no digits cancel, however soft the springs are.
"""

from collections.abc import Callable
from typing import Protocol

import numpy as np
from mpi4py import MPI
from scipy.linalg import LinAlgError, cho_factor, cho_solve
from scipy.sparse import block_diag, csr_matrix, diags

from feti_homog.errors import ConvergenceError
from feti_homog.feti.decomposition.jump_operator import NodeBlocks
from feti_homog.feti.operators.interface_operators import InterfaceOperators
from feti_homog.system.parallel import distributed_arrays, mpi_errors
from feti_homog.typing import Float


class Preconditioner(Protocol):
    """A preconditioner z = M^-1 r for r (owned rows,) or (owned rows, k).  All methods are collective.

    Attributes:
        is_exact: whether M^-1 is the inverse of the projected dual operator, so that no iterations are needed.
        norm: upper bound of |M^-1|; inf if no bound is known.
    """

    is_exact: bool = False
    norm: float = np.inf

    def activate(self, active: Float) -> None:
        """Restrict the preconditioner to rows where `active` (owned rows,) is 1; by default all rows stay active."""
        return

    def soften(self, more: Float) -> None:
        """Add `more` (owned rows,) to the intact spring compliance, from the next `activate` on.

        By default raises ValueError: the preconditioner takes constant compliance.
        """
        raise ValueError("springs soften; expected constant compliance, as the preconditioner was set up")

    def apply(self, r: Float) -> Float:
        """Compute M^-1 r; r and the result are 0 on inactive rows."""

    def closing_forces(self, jump: Float) -> Float:
        """Compute forces that close a jump, with coarse displacements fixed; by default M^-1 `jump`."""
        return self.apply(jump)


class Identity(Preconditioner):
    """The identity, z = r, for any active rows: r is 0 on inactive rows."""

    def apply(self, r: Float) -> Float:
        """Return a copy of r."""
        return r.copy()


class StiffnessScaled(Preconditioner):
    """The preconditioner M^-1 of this module, with any boundary stiffness S.

    Attributes:
        BD: (local rows, boundary dofs) B D^-1.
        W_inverse: (owned rows, owned rows) W^-1 of the active rows, 0 elsewhere.
    """

    def __init__(self, operators: InterfaceOperators, stiffness: Callable[[Float], Float]) -> None:
        """Compute B D^-1 and W; `stiffness` maps x (boundary dofs,) or (boundary dofs, k) to S x.  Collective."""
        self.jump_operator, self.stiffness = operators.jump_operator, stiffness
        c = self.jump_operator.components  # all dofs of a node are on the boundary
        flexibility = diags(np.repeat(1.0 / operators.diagonal.reshape(-1, c).mean(axis=1), c))
        self.BD: csr_matrix = (operators.B @ flexibility).tocsr()
        self.DBT = self.BD.T.tocsr()
        self.W = NodeBlocks(operators.comm, self.jump_operator, self.BD @ operators.B.T)
        self.activate(np.ones(self.W.rows))

    def activate(self, active: Float) -> None:
        """Invert W on rows where `active` (owned rows,) is 1."""
        self.W_inverse = self.W.inverse(active)

    def displacement_with_jump(self, g: Float) -> Float:
        """Compute B_D^T g = D^-1 B^T W^-1 g (boundary dofs, k), which has the jumps g on active rows.  Collective."""
        return np.asarray(self.DBT @ self.jump_operator.gather(self.W_inverse @ g))

    def multipliers(self, forces: Float) -> Float:
        """Compute multipliers B_D f = W^-1 B D^-1 f (owned rows, k); B^T lam gives lam on active rows.  Collective."""
        return np.asarray(self.W_inverse @ self.jump_operator.sum(self.BD @ forces))

    def apply(self, r: Float) -> Float:
        """Compute B_D S B_D^T r = W^-1 B D^-1 S D^-1 B^T W^-1 r.  Collective."""
        return self.multipliers(self.stiffness(self.displacement_with_jump(r)))


class Dirichlet(StiffnessScaled):
    """M^-1 with the Schur complements of the subdomains and their springs."""

    def __init__(self, operators: InterfaceOperators) -> None:
        super().__init__(operators, operators.apply_with_springs)


class Lumped(StiffnessScaled):
    """M^-1 with the boundary blocks of K."""

    def __init__(self, operators: InterfaceOperators) -> None:
        parts = zip(operators.subdomains, operators.dofs, strict=True)
        blocks = [s.take_stiffness()[dofs][:, dofs] for s, dofs in parts]
        super().__init__(operators, csr_matrix(block_diag(blocks or [csr_matrix((0, 0))])).__matmul__)


class SpringUpdate:
    """The update of a preconditioner H for springs at nodes where both bodies are cut."""

    def __init__(self, comm: MPI.Intracomm, first: int, compliance: Float, inverse: Callable[[Float], Float]) -> None:
        """Factor C^-1 + X^T H X for the springs where C = `compliance` (owned rows,) is not 0.  Collective.

        `inverse` maps r (owned rows, k) to H r; `first` is the global number of the first owned row.

        Raises:
            ConvergenceError: the springs are so soft that rounding leaves no definite matrix.
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
        self._places, self._mine, self._stiffness = places, mine, stiffness[mine]

    def apply(self, z: Float) -> Float:
        """Update z = H r, (owned rows,) or (owned rows, k), for the springs; z itself without springs.  Collective."""
        if not len(self.rows):
            return z
        stretch = cho_solve(self._factor, distributed_arrays.gather_rows(self.comm, z, self.first, self.rows))
        updated = np.asarray(z - self._columns @ stretch)
        updated[self._places] = distributed_arrays.scale_rows(self._stiffness, stretch[self._mine])
        return updated


def _factored(block: Float) -> tuple[Float, bool]:
    """Return C^-1 + X^T H X = `block` factored for `cho_solve`; raise ConvergenceError if it is not definite."""
    try:
        factor: tuple[Float, bool] = cho_factor(block)
    except LinAlgError as error:
        raise ConvergenceError(
            "[interface] springs too soft beside the pieces of cut fibres, their stiffness is rounding; expected whole "
            "fibres, by fewer [decomposition] subdomains, or -feti_pc_type dirichlet"
        ) from error
    return factor


class SpringUpdated(Preconditioner):
    """A preconditioner H with `SpringUpdate` for the springs of active rows; the springs may soften."""

    def __init__(self, comm: MPI.Intracomm, inner: Preconditioner, first: int, compliance: Float) -> None:
        """Update H = `inner` with all rows active; arguments and exceptions are as in `SpringUpdate`.  Collective."""
        self._comm, self._inner, self._first = comm, inner, first
        self._intact_compliance = self._compliance = compliance
        self.is_exact, self.norm = inner.is_exact, inner.norm  # springs only reduce |H|
        self._update = SpringUpdate(comm, first, compliance, inner.apply)

    def soften(self, more: Float) -> None:
        """Add `more` (owned rows,) to the intact spring compliance, from the next `activate` on."""
        self._compliance = self._intact_compliance + more

    def activate(self, active: Float) -> None:
        """Restrict H to rows where `active` (owned rows,) is 1, and update it, like `SpringUpdate`.  Collective."""
        self._inner.activate(active)
        self._update = SpringUpdate(self._comm, self._first, active * self._compliance, self._inner.apply)

    def apply(self, r: Float) -> Float:
        """Compute the updated H r.  Collective."""
        return self._update.apply(self._inner.apply(r))

    def closing_forces(self, jump: Float) -> Float:
        """Compute the closing forces of H, updated like H r.  Collective."""
        return self._update.apply(self._inner.closing_forces(jump))
