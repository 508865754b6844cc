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

    def __init__(self, comm: MPI.Intracomm, jump_operator: JumpOperator, operators: InterfaceOperators) -> None:
        """Assemble and factor.  Options under `feti_bonded_` (default: cholesky by CHOLMOD).  Collective.

        Raises:
            TypeError: a boundary operator is not dense.
        """
        self.comm = comm
        self._shared_dof = _shared_dof_of(comm, jump_operator, operators)
        self.size = shared_dofs(comm, jump_operator)
        stiffness = DenseBlockSum((self.size, self.size))
        for operator, span in zip(operators.skins, operators.slices, strict=True):
            if not isinstance(operator, ExplicitInterfaceOperator):
                raise TypeError("the assembled Schur complement needs dense boundary operators")
            stiffness.add(self._shared_dof[span], self._shared_dof[span], operator.S)
        self._solver = DirectSolver(allreduce_sparse(comm, stiffness.matrix()), "feti_bonded_")
        n = len(self._shared_dof)
        self._ZT = csr_matrix((np.ones(n), (self._shared_dof, np.arange(n))), shape=(self.size, n))

    def relieving_displacement(self, forces: Float) -> Float:
        """-Z (Z^T S Z)^-1 Z^T f for boundary forces f (n,) or (n, k): it takes them off the shared nodes.
        Collective."""
        right = -self._ZT @ forces
        self.comm.Allreduce(MPI.IN_PLACE, right)
        return self._solver.solve(right)[self._shared_dof]


def shared_dofs(comm: MPI.Intracomm, jump_operator: JumpOperator) -> int:
    """Dofs on the shared nodes of all ranks; collective."""
    return int(comm.allreduce(2 * len(jump_operator.node_rows[0])))


def _shared_dof_of(comm: MPI.Intracomm, jump_operator: JumpOperator, operators: InterfaceOperators) -> Int:
    """(n,) the global number of the shared dof that each boundary dof is a copy of.  Collective."""
    starts, sizes = jump_operator.node_rows
    order = np.argsort(starts)
    first = comm.exscan(len(starts)) or 0
    node = jump_operator.gather(np.repeat(first + np.arange(len(starts)), sizes[order]).astype(float))
    # Each copy of a node takes part in some row of it, and its two dofs are neighbours.
    row = operators.BT.indices[operators.BT.indptr[:-1]]
    return np.asarray(2 * node[row].astype(np.int64) + np.arange(len(row)) % 2)
