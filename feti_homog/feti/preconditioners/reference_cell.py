"""The cell with a reference set A of active rows, factored: what unit jumps on A and unit forces on the others do.

Jumps g on the rows of A and forces f on the others I, each on both faces, make multipliers on A and gaps on I,

    (lam, gap) = Gamma (g, f),  Gamma = [ F_AA^-1          -F_AA^-1 F_AI                  ]
                                        [ -F_IA F_AA^-1    F_IA F_AA^-1 F_AI - F_II       ],

the principal pivot transform of the dual operator, with F_AA^-1 the inverse on forces in equilibrium.  It is symmetric,
positive semi-definite on A and negative definite on I.
"""

from __future__ import annotations

import numpy as np
from mpi4py import MPI
from scipy.sparse import csr_matrix

from feti_homog.feti.decomposition.jump_operator import JumpOperator
from feti_homog.feti.operators.interface_operators import InterfaceOperators
from feti_homog.feti.preconditioners.assembled_schur import AssembledSchur
from feti_homog.feti.preconditioners.spring_update import SpringUpdate
from feti_homog.feti.thresholds import STIFF_FIBRES
from feti_homog.parallel.distributed_arrays import allreduce_sum, scale_rows
from feti_homog.typing import Float


class ReferenceCell:
    """Gamma of one reference set.

    Attributes:
        active: (owned rows,) 1 on A.
        assembled: the cell with the bonds of A.
    """

    def __init__(
        self,
        comm: MPI.Intracomm,
        jump_operator: JumpOperator,
        operators: InterfaceOperators,
        one_sided: csr_matrix,
        active: Float,
    ) -> None:
        """Factor the cell; A must leave no rigid-body motion free.  `one_sided` is B_D.  Collective."""
        self.active = active
        self._jump_operator, self._operators = jump_operator, operators
        self._BD, self._BDT = one_sided, one_sided.T.tocsr()
        reached = self._BDT.getnnz(axis=1) > 0
        self._reached = [bool(reached[own].any()) for own in operators.slices]
        self.assembled = AssembledSchur(comm, jump_operator, operators, active)
        self._is_bonded = not comm.allreduce(bool((active == 0).any()), MPI.LOR)
        first = jump_operator.owned[0]
        self._springs = SpringUpdate(comm, first, active * operators.compliance, self._without_springs)

    def destroy(self) -> None:
        """Free the factor."""
        self.assembled.destroy()

    def respond(self, x: Float) -> Float:
        """Gamma x for x (owned rows,) or (owned rows, k).  Collective."""
        return self._springs.apply(self._without_springs(x))

    def _without_springs(self, x: Float) -> Float:
        """The same without the springs at nodes of A where fibre and matrix are both cut.

        Displacements u = B_D^T g + Z y whose forces S u - B_I^T f vanish on Z; then B_A^T lam = S u - B_I^T f.
        """
        operators, jump_operator = self._operators, self._jump_operator
        g, f = scale_rows(self.active, x), scale_rows(1.0 - self.active, x)
        u = self._BDT @ jump_operator.gather(g)
        pulled = 0.0 if self._is_bonded else operators.BT @ jump_operator.gather(f)
        u = u + self.assembled.relieving_displacement(operators.apply_some_skins(self._reached, u) - pulled)
        forces = operators.apply_some_skins(self._reached, u) - pulled
        lam = scale_rows(self.active, jump_operator.sum(self._BD @ forces))
        if self._is_bonded:
            return lam
        gap = -jump_operator.sum(operators.B @ u) - scale_rows(operators.compliance, f)
        return lam + scale_rows(1.0 - self.active, gap)


def one_sided_jumps(comm: MPI.Intracomm, jump_operator: JumpOperator, operators: InterfaceOperators) -> csr_matrix:
    """(local rows, boundary dofs) B_D with B B_D^T = I that leaves one side of each interface at rest, so that forces
    are wanted of the other alone: of the inner body, if it is not so stiff that rounding would tell.  Collective."""
    inside, B = jump_operator.inside, operators.B.tocoo()
    is_bond = inside >= 0
    inner, mine = inside[B.row], is_bond[B.row]
    # Of each inner body and what is around it: the mean diagonal stiffness.
    side = 2 * inner + operators.of_fibre[B.col]
    most = 2 * (comm.allreduce(int(inside.max(initial=-1)), MPI.MAX) + 1)
    weights = B.data[mine] ** 2
    sums = [np.bincount(side[mine], values, most) for values in (weights * operators.diagonal[B.col[mine]], weights)]
    total, count = allreduce_sum(comm, np.stack(sums))
    outer_mean, inner_mean = (total / np.maximum(count, 1.0)).reshape(-1, 2).T
    moves_inner = np.append(inner_mean <= STIFF_FIBRES * outer_mean, False)[inside]
    moved = ~mine | (operators.of_fibre[B.col] == moves_inner[B.row])
    copies = np.where(is_bond, jump_operator.copies[np.arange(len(inside)), moves_inner.astype(int)], 1)
    return csr_matrix(((copies[B.row] * B.data)[moved], (B.row[moved], B.col[moved])), shape=B.shape)
