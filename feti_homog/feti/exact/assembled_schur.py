"""The cell with the bonds of its active rows, on its shared nodes: u = Z y with B Z = 0 on these rows."""

import numpy as np
from mpi4py import MPI
from scipy.sparse import csr_matrix, diags, hstack

from feti_homog.feti.linalg.dense_matrices import DenseSolver
from feti_homog.feti.linalg.sparse_direct import DirectSolver
from feti_homog.feti.linalg.sparse_matrices import DenseBlockSum, allreduce_sparse
from feti_homog.feti.operators.interface_operators import InterfaceOperators
from feti_homog.feti.operators.with_springs import is_dense
from feti_homog.feti.thresholds import DEFAULTS
from feti_homog.system.parallel import distributed_arrays
from feti_homog.system.petsc import options_database
from feti_homog.typing import Float


class AssembledSchur:
    """Z^T S Z of all subdomains, factored once; every rank holds the factor.

    All copies of a node move together, but along rows that are not active copies of the inner body move on their own.

    Attributes:
        size: columns of Z, on all ranks.
    """

    def __init__(self, comm: MPI.Intracomm, Z: csr_matrix, stiffness: csr_matrix | Float) -> None:
        """Factor, with the arguments of `assembled_stiffness`.

        Dense matrices by LAPACK; options of sparse ones have the prefix `feti_bonded_` (default: cholesky by CHOLMOD).
        """
        self.comm, self.size = comm, Z.shape[1]
        self._solver: DirectSolver | DenseSolver
        if isinstance(stiffness, np.ndarray):
            self._solver = DenseSolver(stiffness)
        else:
            self._solver = DirectSolver(stiffness, "feti_bonded_")
        self._Z, self._ZT = Z, Z.T.tocsr()

    def relieving_displacement(self, forces: Float) -> Float:
        """-Z (Z^T S Z)^-1 Z^T f for boundary forces f (n,) or (n, k): it takes them off the shared nodes.

        Collective.
        """
        right = -self._ZT @ forces
        self.comm.Allreduce(MPI.IN_PLACE, right)
        return np.asarray(self._Z @ distributed_arrays.share_columns(self.comm, self._solver.solve, right))

    def destroy(self) -> None:
        """Free the factor."""
        self._solver.destroy()


def assembled_stiffness(operators: InterfaceOperators, active: Float) -> tuple[csr_matrix, csr_matrix | Float]:
    """Return Z (n, columns) and Z^T S Z of all ranks for the owned rows where `active` is 1.  Collective.

    The rows must leave no rigid-body motion free.  The sum is dense, in Fortran order, where all ranks' blocks have
    as many entries as the whole matrix and there are no options `feti_bonded_`; sparse otherwise.

    Raises:
        TypeError: a boundary operator is not dense.
    """
    comm, Z = operators.comm, _released(operators, active)
    size, columns = Z.shape[1], [np.unique(Z[span].indices) for span in operators.slices]
    entries = comm.allreduce(sum(len(of) ** 2 for of in columns))
    is_full = (
        entries >= size**2 and size <= DEFAULTS.dense_boundary_dofs and not options_database.choices("feti_bonded_")
    )
    dense, blocks = np.zeros((size, size) if is_full else (0, 0)), DenseBlockSum((size, size))
    for operator, span, of in zip(operators.with_springs, operators.slices, columns, strict=True):
        if not is_dense(operator):
            raise TypeError("the assembled Schur complement needs dense boundary operators")
        T = Z[span][:, of].T.tocsr()
        block = T @ (T @ operator.S).T
        if is_full:
            dense[of[:, None], of] += block
        else:
            blocks.add(of, of, block)
    if not is_full:
        return Z, allreduce_sparse(comm, blocks.matrix())
    comm.Allreduce(MPI.IN_PLACE, dense)
    return Z, dense.T


def _released(operators: InterfaceOperators, active: Float) -> csr_matrix:
    """(n, columns) Z, from the one with all rows active.

    u_f = y - e (e . y) + e w along the direction e of each row that is not active, with an extra column for w.
    Collective.
    """
    released, comm, jump_operator = active == 0, operators.comm, operators.jump_operator
    starts, sizes = jump_operator.node_rows
    first = comm.exscan(len(starts)) or 0
    node = jump_operator.gather(np.repeat(first + np.arange(len(starts)), sizes[np.argsort(starts)]).astype(float))
    # Each copy of a node takes part in some row of it, and its dofs are neighbours.
    row = operators.BT.indices[operators.BT.indptr[:-1]]
    n, c = len(row), jump_operator.components
    shared = c * node[row].astype(np.int64) + np.arange(n) % c
    together = csr_matrix((np.ones(n), (np.arange(n), shared)), shape=(n, jump_operator.shared_dofs))
    counts = comm.allgather(int(released.sum()))
    number = np.where(released, sum(counts[: comm.rank]) + np.cumsum(released), 0)
    number = jump_operator.gather(number.astype(float)).astype(np.int64) - 1
    rows = np.flatnonzero(number >= 0)
    # A row takes the mean of the inner copies, with the sign of minus.
    e = (
        -diags(jump_operator.copies[rows, 1].astype(float))
        @ operators.B[rows]
        @ diags(operators.of_inner.astype(float))
    )
    square = np.asarray(e.multiply(e).sum(axis=1)).ravel()
    rows, e, square = rows[square > 0], e.tocsr()[square > 0], square[square > 0]
    directions = csr_matrix((np.ones(len(rows)), (np.arange(len(rows)), number[rows])), shape=(len(rows), sum(counts)))
    common = (together - e.T @ (diags(1.0 / square) @ (e @ together))).tocsr()
    common.eliminate_zeros()
    apart = (e.T @ directions).tocsr()
    apart.eliminate_zeros()
    return hstack([common, apart]).tocsr()
