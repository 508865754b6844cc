"""Preconditioners of the dual problem: none, lumped, Dirichlet, scaled by stiffness; and their update for springs.

M^-1 = W^-1 B D^-1 S D^-1 B^T W^-1 on the active rows, with W = B D^-1 B^T and D the mean diagonal stiffness of
each node.  W is block-diagonal by node.  S is the boundary block of K (lumped), or its Schur complement (Dirichlet).

No subdomain can include the springs at the few nodes where both bodies are cut.  With the compliances C of these rows
X, the preconditioner H, which is M^-1 or H_0, becomes

    H - H X (C^-1 + X^T H X)^-1 X^T H,

which is (H^-1 + X C X^T)^-1 where H is definite, as H_0 is on G^T lam = 0.  On the rows X this is

    C^-1 (C^-1 + X^T H X)^-1 X^T H,

in which no digits cancel, however soft the springs are.
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
    """z = M^-1 r on the owned rows, for r (owned rows,) or (owned rows, k).  All calls are collective.

    Attributes:
        is_exact: whether it is the inverse of the projected dual operator, so that nothing is left to iterate.
        norm: bound of |M^-1|; inf if none is known.
    """

    is_exact: bool = False
    norm: float = np.inf

    def activate(self, active: Float) -> None:
        """Restrict the preconditioner to the rows where `active` is 1."""

    def soften(self, more: Float) -> None:
        """Give springs `more` compliance (owned rows,) than at first, from the next `activate` on.

        Raises:
            ValueError: the preconditioner was set up for springs that never soften.
        """
        raise ValueError("springs soften, and the preconditioner was set up for springs that never do")

    def apply(self, r: Float) -> Float:
        """Compute M^-1 r; r and the result are 0 on inactive rows."""

    def closing_forces(self, jump: Float) -> Float:
        """Compute the forces that close a jump while coarse displacements are fixed; else M^-1 times the jump."""
        return self.apply(jump)


class Identity(Preconditioner):
    """The identity, z = r."""

    def activate(self, active: Float) -> None:
        """Do nothing: the identity is the same on all rows."""

    def apply(self, r: Float) -> Float:
        """Copy r."""
        return r.copy()


class StiffnessScaled(Preconditioner):
    """M^-1 with the scaling of this module around a boundary stiffness.

    Attributes:
        BD: (local rows, boundary dofs) B D^-1.
        W_inverse: (owned rows, owned rows) W^-1 of the active rows, 0 on the others.
    """

    def __init__(self, operators: InterfaceOperators, stiffness: Callable[[Float], Float]) -> None:
        """`stiffness` is x -> S x for x (boundary dofs,) or (boundary dofs, k).  Collective."""
        self.jump_operator, self.stiffness = operators.jump_operator, stiffness
        # All dofs of a node are on the boundary.
        c = self.jump_operator.components
        flexibility = diags(np.repeat(1.0 / operators.diagonal.reshape(-1, c).mean(axis=1), c))
        self.BD: csr_matrix = (operators.B @ flexibility).tocsr()
        self.DBT = self.BD.T.tocsr()
        self.W = NodeBlocks(operators.comm, self.jump_operator, self.BD @ operators.B.T)
        self.activate(np.ones(self.W.rows))

    def activate(self, active: Float) -> None:
        """Invert the active part of W."""
        self.W_inverse = self.W.inverse(active)

    def displacement_with_jump(self, g: Float) -> Float:
        """Compute displacements B_D^T g = D^-1 B^T W^-1 g with the jumps g on the active rows."""
        return np.asarray(self.DBT @ self.jump_operator.gather(self.W_inverse @ g))

    def multipliers(self, forces: Float) -> Float:
        """Compute B_D f = W^-1 B D^-1 f: the lam on the active rows with B^T lam = f, if it exists."""
        return np.asarray(self.W_inverse @ self.jump_operator.sum(self.BD @ forces))

    def apply(self, r: Float) -> Float:
        """Compute W^-1 B D^-1 S D^-1 B^T W^-1 r."""
        return self.multipliers(self.stiffness(self.displacement_with_jump(r)))


class Dirichlet(StiffnessScaled):
    """M^-1 with the Schur complements of the subdomains."""

    def __init__(self, operators: InterfaceOperators) -> None:
        super().__init__(operators, operators.apply_with_springs)


class Lumped(StiffnessScaled):
    """M^-1 with the boundary blocks of K."""

    def __init__(self, operators: InterfaceOperators) -> None:
        parts = zip(operators.subdomains, operators.dofs, strict=True)
        blocks = [s.take_stiffness()[dofs][:, dofs] for s, dofs in parts]
        super().__init__(operators, csr_matrix(block_diag(blocks or [csr_matrix((0, 0))])).__matmul__)


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
