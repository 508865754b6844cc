"""The factored cell with a reference set A of active rows, and its response Gamma to jumps and forces.

Jumps g on the active rows A and forces f on both faces of the inactive rows I cause multipliers on A and gaps on I:

    (lam, gap) = Gamma (g, f),  Gamma = [ F_AA^-1          -F_AA^-1 F_AI                  ]
                                        [ -F_IA F_AA^-1    F_IA F_AA^-1 F_AI - F_II       ].

Gamma is the principal pivot transform of the dual operator, with F_AA^-1 the inverse on forces in equilibrium: it is
symmetric, positive semi-definite on A and negative definite on I.
"""

from collections.abc import Iterator

import numpy as np
from mpi4py import MPI
from scipy.sparse import csr_matrix, diags, hstack

from feti_homog.feti.decomposition.jump_operator import JumpOperator
from feti_homog.feti.linalg.dense_matrices import DenseSolver
from feti_homog.feti.linalg.sparse_direct import DirectSolver
from feti_homog.feti.linalg.sparse_matrices import allreduce_sparse, sum_of_blocks
from feti_homog.feti.operators.interface_operators import InterfaceOperators
from feti_homog.feti.operators.preconditioners import Preconditioner, SpringUpdate
from feti_homog.feti.operators.with_springs import is_dense
from feti_homog.feti.thresholds import COLUMNS_AT_ONCE, DEFAULTS, STIFF_FIBRES
from feti_homog.system.parallel import distributed_arrays
from feti_homog.system.petsc import options_database
from feti_homog.typing import Float, Int


class AssembledSchur:
    """The assembled Schur complement Z^T S Z of all subdomains; every rank has the whole factor.

    S includes springs (`InterfaceOperators.with_springs`).  Boundary displacements u = Z y have no jump on active rows,
    B Z = 0: all copies of a node move together, but at inactive rows the copies of the inner body move independently.

    Attributes:
        size: number of columns of Z, over all ranks.
    """

    def __init__(self, operators: InterfaceOperators, active: Float) -> None:
        """Assemble and factor Z^T S Z.  Collective.

        Rows where `active` (owned rows,) is 1 must leave no rigid-body motion free.  LAPACK factors dense matrices;
        options for sparse matrices have the prefix `feti_bonded_` (default: cholesky by CHOLMOD).

        Boundary operators must be dense.  Raises like `DirectSolver`.
        """
        is_inactive, comm, jump_operator = active == 0, operators.comm, operators.jump_operator
        starts, sizes = jump_operator.node_rows
        first = comm.exscan(len(starts)) or 0
        node = jump_operator.gather(np.repeat(first + np.arange(len(starts)), sizes[np.argsort(starts)]).astype(float))
        # Each node copy has an entry in some row of the node, and its dofs are consecutive.
        row = operators.BT.indices[operators.BT.indptr[:-1]]
        n, c = len(row), jump_operator.components
        shared = c * node[row].astype(np.int64) + np.arange(n) % c
        together = csr_matrix((np.ones(n), (np.arange(n), shared)), shape=(n, jump_operator.shared_dofs))
        # The inner body moves by u = y - e (e . y) + e w along the direction e of an inactive row, with a column for w.
        counts = comm.allgather(int(is_inactive.sum()))
        number = np.where(is_inactive, sum(counts[: comm.rank]) + np.cumsum(is_inactive), 0)
        number = jump_operator.gather(number.astype(float)).astype(np.int64) - 1
        rows = np.flatnonzero(number >= 0)
        # A row has the mean of the inner copies, with a minus sign.
        minus_copies, of_inner = -jump_operator.copies[rows, 1].astype(float), operators.of_inner.astype(float)
        e = diags(minus_copies) @ operators.B[rows] @ diags(of_inner)
        square = np.asarray(e.multiply(e).sum(axis=1)).ravel()
        is_local = square > 0
        rows, e, square = rows[is_local], e.tocsr()[is_local], square[is_local]
        entries = np.ones(len(rows)), (np.arange(len(rows)), number[rows])
        directions = csr_matrix(entries, shape=(len(rows), sum(counts)))
        common = (together - e.T @ (diags(1.0 / square) @ (e @ together))).tocsr()
        common.eliminate_zeros()
        apart = (e.T @ directions).tocsr()
        apart.eliminate_zeros()
        Z = hstack([common, apart]).tocsr()
        self.comm, self.size, self._Z, self._ZT = comm, Z.shape[1], Z, Z.T.tocsr()
        stiffness = assembled_stiffness(operators, Z)
        self._solver: DirectSolver | DenseSolver
        if isinstance(stiffness, np.ndarray):
            self._solver = DenseSolver(stiffness)
        else:
            self._solver = DirectSolver(stiffness, "feti_bonded_")

    def relieving_displacement(self, forces: Float) -> Float:
        """Compute u = -Z (Z^T S Z)^-1 Z^T f, which balances boundary forces f (n,) or (n, k).  Collective."""
        right = -self._ZT @ forces
        self.comm.Allreduce(MPI.IN_PLACE, right)
        return np.asarray(self._Z @ distributed_arrays.share_columns(self.comm, self._solver.solve, right))

    def destroy(self) -> None:
        """Free the factor."""
        self._solver.destroy()


def assembled_stiffness(operators: InterfaceOperators, Z: csr_matrix) -> csr_matrix | Float:
    """Sum Z^T S Z (m, m) over all ranks for Z (n, m); S includes springs, as in `AssembledSchur`.  Collective.

    The sum is dense, in Fortran order, if the blocks of all ranks have at least m^2 entries, m is at most
    `dense_boundary_dofs`, and no option begins with `feti_bonded_`; else sparse.  Boundary operators must be dense.
    """
    comm, size, columns = operators.comm, Z.shape[1], [np.unique(Z[span].indices) for span in operators.slices]

    def blocks() -> Iterator[tuple[Int, Int, Float]]:
        for operator, span, j in zip(operators.with_springs, operators.slices, columns, strict=True):
            assert is_dense(operator)  # `solver_plan.choose` refuses others
            T = Z[span][:, j].T.tocsr()
            yield j, j, T @ (T @ operator.S).T

    entries = comm.allreduce(sum(len(j) ** 2 for j in columns))
    if entries < size**2 or size > DEFAULTS.dense_boundary_dofs or options_database.choices("feti_bonded_"):
        return allreduce_sparse(comm, sum_of_blocks((size, size), blocks()))
    dense = np.zeros((size, size))
    for j, _, block in blocks():
        dense[j[:, None], j] += block
    comm.Allreduce(MPI.IN_PLACE, dense)
    return dense.T


class BodyTies:
    """Two bonds that tie an inner body to the body around it: the first bond, and the bond farthest from the first."""

    def __init__(self, comm: MPI.Intracomm, jump_operator: JumpOperator) -> None:
        """Choose the two bonds of every pair of bodies.  Collective."""
        nodes = jump_operator.nodes
        self._comm = comm
        self._rows = nodes.row[:, None] + np.arange(jump_operator.components)
        bodies, points = (np.concatenate(comm.allgather(x)) for x in (nodes.bodies, nodes.points))
        _, first, pair = np.unique(bodies, axis=0, return_index=True, return_inverse=True)
        pair = pair.ravel()
        distance = np.linalg.norm(points - points[first[pair]], axis=1)
        order = np.lexsort([distance, pair])
        last = order[np.cumsum(np.bincount(pair)) - 1] if len(pair) else first
        begin = comm.exscan(len(nodes.row)) or 0
        self._ties = np.stack([first, last], axis=1) - begin
        self._pair = pair[begin : begin + len(nodes.row)]

    def tied(self, active: Float) -> Float:
        """Copy `active` (owned rows,), with 1 on the ties of bodies with fewer than two bonds.  Collective."""
        bonded = active[self._rows].prod(axis=1)
        local = np.bincount(self._pair, bonded, len(self._ties)).astype(float)
        bonds = distributed_arrays.allreduce_sum(self._comm, local)
        ties = self._ties[bonds < self._ties.shape[1]].ravel()
        rows = self._rows[ties[(ties >= 0) & (ties < len(self._rows))]]
        tied = active.copy()
        tied[rows] = 1.0
        return tied


class ReferenceCell:
    """The response Gamma of the cell with the active rows A.

    Attributes:
        active: (owned rows,) 1 on A, else 0.
        assembled: assembled Schur complement with the bonds of A.
    """

    def __init__(self, operators: InterfaceOperators, one_sided: csr_matrix, active: Float) -> None:
        """Factor the cell with the active rows A; `one_sided` is B_D of `one_sided_jumps`.  Collective.

        Raises like `AssembledSchur` and `SpringUpdate`.
        """
        comm, jump_operator = operators.comm, operators.jump_operator
        self._comm, self.active, self._jump_operator, self._operators = comm, active, jump_operator, operators
        self._BD, self._BDT = one_sided, one_sided.T.tocsr()
        reached = self._BDT.getnnz(axis=1) > 0
        self._reached = [bool(reached[span].any()) for span in operators.slices]
        self.assembled = AssembledSchur(operators, active)
        self._is_bonded = not comm.allreduce(bool((active == 0).any()), MPI.LOR)
        self._first = jump_operator.owned[0]
        self._springs = SpringUpdate(comm, self._first, active * operators.compliance, self._without_springs)

    def destroy(self) -> None:
        """Free the factor."""
        self.assembled.destroy()

    def respond(self, x: Float) -> Float:
        """Compute the multipliers and gaps Gamma x for x (owned rows,) or (owned rows, k).  Collective."""
        return self._springs.apply(self._without_springs(x))

    def columns(self, rows: Int) -> Float:
        """Compute columns Gamma[:, rows] (owned rows, k) for global rows (k,), equal on all ranks.  Collective."""
        # Batches of about COLUMNS_AT_ONCE: a small last batch would cost more than slightly larger batches.
        columns = [np.zeros((len(self.active), 0))]
        for batch in np.array_split(rows, max(round(len(rows) / COLUMNS_AT_ONCE), 1)) if len(rows) else []:
            unit, place = np.zeros((len(self.active), len(batch))), batch - self._first
            mine = np.flatnonzero((place >= 0) & (place < len(unit)))
            unit[place[mine], mine] = 1.0
            columns.append(self.respond(unit))
        return np.hstack(columns)

    def force_of_rigid_motions(self, stiffness: Float) -> float:
        """Measure rounding: max |Gamma r| / `stiffness` (owned rows,), jumps r of rigid-body motions.  Collective."""
        bodies = zip(self._operators.subdomains, self._operators.dofs, strict=True)
        motions = [s.R[dofs].sum(axis=1) for s, dofs in bodies]
        units = (motion / (np.abs(motion).max(initial=0.0) or 1.0) for motion in motions)
        moved = np.concatenate([np.zeros(0), *units])
        jump = distributed_arrays.scale_rows(self.active, self._jump_operator.sum(self._operators.B @ moved))
        force = distributed_arrays.scale_rows(self.active, self.respond(jump)) / stiffness
        return float(self._comm.allreduce(np.abs(force).max(initial=0.0), MPI.MAX))

    def _without_springs(self, x: Float) -> Float:
        """Compute Gamma x without the springs C at nodes of A where both bodies are cut.  Collective.

        With x = (g, f): u = B_D^T g + Z y, Z^T (S u - B_I^T f) = 0, B_A^T lam = S u - B_I^T f, gap = -B_I u - C_I f.
        """
        operators, jump_operator = self._operators, self._jump_operator
        g, f = distributed_arrays.scale_rows(self.active, x), distributed_arrays.scale_rows(1.0 - self.active, x)
        has_forces = not self._is_bonded and self._comm.allreduce(bool(f.any()), MPI.LOR)
        load = operators.BT @ jump_operator.gather(f) if has_forces else 0.0

        def forces_by(u: Float) -> Float:
            forces = operators.apply_with_springs(u, self._reached)
            return forces - load if has_forces else forces

        u = self._BDT @ jump_operator.gather(g)
        u += self.assembled.relieving_displacement(forces_by(u))
        lam = distributed_arrays.scale_rows(self.active, jump_operator.sum(self._BD @ forces_by(u)))
        if self._is_bonded:
            return lam
        gap = -jump_operator.sum(operators.B @ u)
        if has_forces:
            gap -= distributed_arrays.scale_rows(operators.compliance, f)
        return lam + distributed_arrays.scale_rows(1.0 - self.active, gap)


def one_sided_jumps(operators: InterfaceOperators) -> csr_matrix:
    """Build B_D (local rows, boundary dofs), B B_D^T = I; B_D^T moves one body at every bond.  Collective.

    Then columns of Gamma need only forces of the moved bodies.  The inner body moves, unless its forces would lose
    digits because it is more than STIFF_FIBRES times as stiff as the outer body.
    """
    comm, jump_operator = operators.comm, operators.jump_operator
    inside, B = jump_operator.inside, operators.B.tocoo()
    is_bond = inside >= 0
    inner, mine = inside[B.row], is_bond[B.row]
    # The mean diagonal stiffness on both sides of every interface, numbered by the inner body.
    side = 2 * inner + operators.of_inner[B.col]
    side_count = 2 * (comm.allreduce(int(inside.max(initial=-1)), MPI.MAX) + 1)
    weights = B.data[mine] ** 2
    terms = weights * operators.diagonal[B.col[mine]], weights
    sums = [np.bincount(side[mine], values, side_count) for values in terms]
    total, count = distributed_arrays.allreduce_sum(comm, np.stack(sums).astype(float))  # integers if no bonds
    outer_mean, inner_mean = (total / np.maximum(count, 1.0)).reshape(-1, 2).T
    moves_inner = np.append(inner_mean <= STIFF_FIBRES * outer_mean, False)[inside]
    moved = ~mine | (operators.of_inner[B.col] == moves_inner[B.row])
    copies = np.where(is_bond, jump_operator.copies[np.arange(len(inside)), moves_inner.astype(int)], 1)
    return csr_matrix(((copies[B.row] * B.data)[moved], (B.row[moved], B.col[moved])), shape=B.shape)


class BondedInverse(Preconditioner):
    """The preconditioner z = H r, with the inverse H of the dual operator from a factored cell with all rows active.

    It serves subdomains of several materials, where no bond can break.
    """

    is_exact = True

    def __init__(self, operators: InterfaceOperators) -> None:
        """Factor the cell with all bonds intact, from dense operators; raises like `ReferenceCell`.  Collective."""
        self._cell = ReferenceCell(operators, one_sided_jumps(operators), np.ones(len(operators.springs)))

    def apply(self, r: Float) -> Float:
        """Compute H r for r (owned rows,) or (owned rows, k).  Collective."""
        return self._cell.respond(r)
