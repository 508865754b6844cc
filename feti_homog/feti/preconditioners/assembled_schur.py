"""The cell with all bonds intact, on the shared nodes: one displacement a node, u = Z y with B Z = 0."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI
from scipy.sparse import csr_matrix

from feti_homog.feti.decomposition.jump_operator import JumpOperator
from feti_homog.feti.linalg.collectives import allreduce_sparse
from feti_homog.feti.linalg.dense_block_sum import DenseBlockSum
from feti_homog.feti.linalg.sparse_direct import DirectSolver
from feti_homog.feti.operators.explicit import ExplicitInterfaceOperator
from feti_homog.feti.operators.interface_operators import InterfaceOperators
from feti_homog.typing import Float, Int


class AssembledSchur:
    """Z^T S Z of all subdomains, factored once; every rank holds the factor.

    Attributes:
        size: dofs on the shared nodes of all ranks, two each.
    """

    def __init__(self, comm: MPI.Intracomm, jump_operator: JumpOperator, boundary: InterfaceOperators) -> None:
        """Assemble and factor; all boundary operators must be dense.  Collective.

        Options have the prefix `feti_bonded_` (default: cholesky by CHOLMOD).
        """
        self.comm = comm
        self._shared = _originals(comm, jump_operator, boundary)
        self.size = shared_dofs(comm, jump_operator)
        stiffness = DenseBlockSum((self.size, self.size))
        for operator, span in zip(boundary.operators, boundary.slices, strict=True):
            if not isinstance(operator, ExplicitInterfaceOperator):
                raise TypeError("the bonded cell needs dense boundary operators")
            stiffness.add(self._shared[span], self._shared[span], operator.S)
        self._solver = DirectSolver(allreduce_sparse(comm, stiffness.matrix()), "feti_bonded_")
        entries = np.ones(len(self._shared)), (self._shared, np.arange(len(self._shared)))
        self._ZT = csr_matrix(entries, shape=(self.size, len(self._shared)))

    def relaxed(self, forces: Float) -> Float:
        """-Z (Z^T S Z)^-1 Z^T f for boundary forces f (n,) or (n, k): the motion that takes them off shared nodes."""
        right = -self._ZT @ forces
        self.comm.Allreduce(MPI.IN_PLACE, right)
        return self._solver.solve(right)[self._shared]


def shared_dofs(comm: MPI.Intracomm, jump_operator: JumpOperator) -> int:
    """The size of the bonded cell; collective."""
    return int(comm.allreduce(2 * len(jump_operator.node_rows[0])))


def _originals(comm: MPI.Intracomm, jump_operator: JumpOperator, boundary: InterfaceOperators) -> Int:
    """The global number of the shared dof that each boundary dof is a copy of."""
    starts, sizes = jump_operator.node_rows
    order = np.argsort(starts)
    first = comm.exscan(len(starts)) or 0
    node = jump_operator.gather(np.repeat(first + np.arange(len(starts)), sizes[order]).astype(float))
    # Each copy of a node takes part in some row of it, and its two dofs are neighbours.
    row = boundary.BT.indices[boundary.BT.indptr[:-1]]
    return np.asarray(2 * node[row].astype(np.int64) + np.arange(len(row)) % 2)
