"""Preconditioners of the dual problem: none, lumped, Dirichlet, scaled by stiffness.

M^-1 = W^-1 B D^-1 S D^-1 B^T W^-1 on the active rows, with W = B D^-1 B^T and D the mean diagonal stiffness of
each node.  W is block-diagonal by node.  S is the boundary block of K (lumped), or its Schur complement (Dirichlet).
"""

from collections.abc import Callable
from typing import Protocol

import numpy as np
from scipy.sparse import block_diag, csr_matrix, diags

from feti_homog.feti.decomposition.jump_operator import NodeBlocks
from feti_homog.feti.operators.interface_operators import InterfaceOperators
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

    def apply(self, r: Float) -> Float:
        """Compute M^-1 r; r and the result are 0 on inactive rows."""

    def closing_forces(self, jump: Float) -> Float:
        """Compute the forces that close a jump while coarse displacements are fixed; else M^-1 times the jump."""
        return self.apply(jump)


def never_softens(preconditioner: Preconditioner, more: Float) -> None:
    """Refuse to soften springs: `soften` of preconditioners without `SpringUpdated`."""
    raise ValueError("springs soften, and the preconditioner was set up for springs that never do")


class Identity(Preconditioner):
    """The identity, z = r."""

    soften = never_softens

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

    soften = never_softens

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
