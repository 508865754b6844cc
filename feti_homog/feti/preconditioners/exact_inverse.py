"""The inverse H of the projected dual operator, exact for any active rows, by columns of a reference cell.

Let Gamma be the response of a cell whose active rows are A, `reference_cell`, and C the rows that are active either
here or there: D of A have left, R beside A have come.  The multipliers that close the jumps g are

    y = Gamma_:A g_A,  c = N (y_C + g_R),  lam_A = y_A - Gamma_AC c,  lam_R = -c_R,  N = Gamma_CC^-1.

A spring whose compliance grew by dC is one of C, whose jump dC lam is prescribed by its own multiplier:

    N = (Gamma_CC + D)^-1,  lam_C = D c on such rows,  D = dC^-1 there, and 0 where bonds left.

A bond that breaks costs two columns and two borders of N, a face that closes or opens one border, a bond that softens
an update of rank two; no factor is made anew.  After as many changes as an option says, the cell as it stands becomes
the reference, but for what softened.
"""

from __future__ import annotations

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy.sparse import identity

from feti_homog.errors import CaseError
from feti_homog.feti.decomposition.interface_neighbours import InterfaceNeighbours
from feti_homog.feti.decomposition.jump_operator import JumpOperator
from feti_homog.feti.operators.interface_operators import InterfaceOperators
from feti_homog.feti.preconditioners.bordered_inverse import BorderedInverse
from feti_homog.feti.preconditioners.reference_cell import BodyTies, ReferenceCell, ResponseColumns, one_sided_jumps
from feti_homog.feti.preconditioners.scaled import Preconditioner
from feti_homog.feti.thresholds import INFLUENCE_BATCH, INFLUENCE_COLUMNS, NORM_ITERATIONS, NORM_MARGIN
from feti_homog.parallel.distributed_arrays import allreduce_sum, gather_rows, scale_rows
from feti_homog.typing import Float, Int


class ExactInverse(Preconditioner):
    """z = H r on the active rows, H the inverse of the dual operator there: nothing is left to iterate.

    Attributes:
        neighbours: which bonds lie beside each other.
        reference: the reference cell.
        norm: |H| with all bonds intact, which is the largest, as the power method finds it, with a margin.
        stiffness: (all rows,) the most that each diagonal entry of H can be: that of a node of either side and of the
            spring between them, in a row, while all others are held.
        rounding: the largest force, relative to `stiffness`, that jumps of rigid-body motions of size 1 make in the
            reference cell, where bodies that follow leave none: a relative error of H.
        factorizations: reference cells so far.
    """

    norm: float = np.inf
    is_exact = True

    def __init__(self, comm: MPI.Intracomm, jump_operator: JumpOperator, operators: InterfaceOperators) -> None:
        """Factor the cell with all bonds intact; all boundary operators must be dense.  Collective.

        Options: `feti_influence_columns`.

        Raises:
            CaseError: the option has no such value.
        """
        self.comm, self._jump_operator, self._operators = comm, jump_operator, operators
        self._first = jump_operator.owned[0]
        self._rows = jump_operator.owned[1] - self._first
        self._most_columns = PETSc.Options("feti_").getInt("influence_columns", INFLUENCE_COLUMNS)
        if self._most_columns < 1:
            raise CaseError(f"-feti_influence_columns {self._most_columns}: expected a whole number above 0")
        self.stiffness = np.concatenate(comm.allgather(_stiffness_of_rows(jump_operator, operators)))
        self._BD = one_sided_jumps(comm, jump_operator, operators)
        self._ties = BodyTies(comm, jump_operator)
        self.neighbours = InterfaceNeighbours(comm, jump_operator, operators.subdomains)
        self._adjacency = self.neighbours.adjacency + identity(self.neighbours.adjacency.shape[0], format="csr")
        self._batch = INFLUENCE_BATCH * comm.size
        # Columns without which the reference cell is not the one at hand.
        self.factorizations = self._tied = 0
        self._answer: Float | None = None
        self._active, self._more = np.ones(self._rows), np.zeros(self._rows)
        self._rebase(self._active)
        # Rows that leave make H smaller.
        self.norm = NORM_MARGIN * self._largest_eigenvalue()

    def soften(self, more: Float) -> None:
        """Let springs have `more` compliance (owned rows,) than at first, from the next `activate` on."""
        self._more = more

    def activate(self, active: Float) -> None:
        """Restrict to the rows where `active` is 1.  Collective."""
        self._active = active
        changed = self._changed()
        if len(changed) > self._tied + self._most_columns:
            # The memory of the old cell goes before the new one takes its own.
            self.reference.destroy()
            self._columns.clear()
            self._rebase(active)
            changed = self._changed()
            self._tied = len(changed)
        self._find(changed)
        self._update_inverse(self._columns.positions(changed))

    def apply(self, r: Float) -> Float:
        """H r for r (owned rows,) or (owned rows, k); 0 on inactive rows.  Collective."""
        return self._restricted(self.reference.respond(scale_rows(self.reference.active, r)), r)

    def multipliers(self, d: Float, E: Float) -> Float:
        """H d E for d (owned rows, v), the same at every call, and E (v, k).

        The solution for the loads E, but for rounding. Collective.

        The reference cell answers to d once.
        """
        if self._answer is None:
            self._answer = self.reference.respond(scale_rows(self.reference.active, d))
        return self._restricted(self._answer @ E, d @ E)

    def inverse_blocks(self, pairs: Int) -> Float:
        """(m, 2, 2) diagonal blocks of H, for the same pairs (m, 2) of active global rows on every rank.  Collective.

        Rows that leave together change the multipliers of their own by all of them, and open by H_ii^-1 lam_i.
        """
        self._find(pairs.ravel())
        at, members = self._columns.positions(pairs.ravel()), self._inverse.members
        block = self._columns.block
        # The rows of U, and of the identity on A.
        U = block[at[:, None], members]
        own = block[at.reshape(-1, 2)[:, :, None], at.reshape(-1, 2)[:, None, :]]
        returned = gather_rows(self.comm, self.reference.active, self._first, pairs.ravel()) == 0
        U[returned] = at[returned, None] == members
        both = ~returned.reshape(-1, 2)
        own = np.where(both[:, :, None] & both[:, None, :], own, 0.0)
        paired = U.reshape(len(pairs), 2, len(members))
        return np.asarray(own - np.matmul((U @ self._inverse.N).reshape(paired.shape), paired.transpose(0, 2, 1)))

    def columns(self, rows: Int) -> tuple[Float, Float]:
        """(owned rows, k) columns of H of the reference cell, and their (k, k) block, for the same global rows (k,).

        They are those of the bonded cell until rows are first restricted.  Collective.
        """
        self._find(rows)
        at = self._columns.positions(rows)
        return self._columns.owned[:, at], self._columns.block[at[:, None], at]

    def _changed(self) -> Int:
        """Return the global rows that are active here or in the reference cell, not both, and those that softened.

        Collective."""
        own = self._first + np.flatnonzero((self._active != self.reference.active) | (self._softened > 0.0))
        return np.concatenate(self.comm.allgather(own))

    @property
    def _softened(self) -> Float:
        """(owned rows,) D: 1 / dC of the springs that softened, of bonds that hold; 0 of all others."""
        soft = (self._active * self.reference.active > 0.0) & (self._more > 0.0)
        return np.divide(1.0, self._more, out=np.zeros(self._rows), where=soft)

    def _rebase(self, active: Float) -> None:
        """Take a cell with these active rows, and what it takes to hold its bodies, for the reference.  Collective."""
        tied = self._ties.tied(active)
        self.reference = ReferenceCell(self.comm, self._jump_operator, self._operators, self._BD, tied)
        self.factorizations += 1
        owned = self._jump_operator.owned
        self._columns = ResponseColumns(self.comm, self.reference, owned, self._jump_operator.global_rows)
        self._inverse, self._dependent = BorderedInverse(self.comm), np.zeros(0, np.int64)
        self._answer, self._tied, self.rounding = None, 0, self._force_of_rigid_motions()

    def _find(self, rows: Int) -> None:
        """Find the columns that these rows lack.  Collective.

        With few also those of bonds near them, which break next, for columns are cheaper together.
        """
        rows = rows[self._columns.positions(rows) < 0]
        if not len(rows):
            return
        normal = self.neighbours.rows
        bonds = np.unique(np.searchsorted(normal, rows, side="right") - 1)
        active = np.concatenate(self.comm.allgather(self._active)) > 0
        while True:
            beside = (normal[bonds][:, None] + np.arange(self._jump_operator.components)).ravel()
            beside = np.union1d(rows, beside[active[beside] & (self._columns.positions(beside) < 0)])
            reached = np.unique(self._adjacency[bonds].indices)
            if len(beside) >= self._batch or len(reached) == len(bonds):
                break
            bonds = reached
        self._columns.add(beside)

    def _update_inverse(self, changed: Int) -> None:
        """Let N be that of the columns `changed`, made anew where updates have lost too many digits.  Collective."""
        self._exchange_members(changed)
        if not self._inverse.holds():
            self._inverse, self._dependent = BorderedInverse(self.comm), np.zeros(0, np.int64)
            self._exchange_members(changed)

    def _exchange_members(self, changed: Int) -> None:
        """Take the columns that are not `changed` out of N, and the others in.  Collective."""
        inverse, M = self._inverse, self._columns.block
        ours = np.stack([self.reference.active, self._softened], axis=1)
        active, softened = gather_rows(self.comm, ours, self._first, self._columns.rows[changed]).T
        returned, size = active == 0, self.stiffness[self._columns.rows]
        D = np.zeros(len(size))
        D[changed] = softened
        # What no longer holds at all is taken out and in again, for N may be singular with it.
        left = (D[inverse.members] == 0.0) & (inverse.added > 0.0)
        gone = np.union1d(np.setdiff1d(inverse.members, changed), inverse.members[left])
        inverse.remove(gone)
        at = np.flatnonzero(D[inverse.members] != inverse.added)
        if len(at):
            inverse.change(at, D[inverse.members[at]])
        taken_in = np.setdiff1d(changed[returned], inverse.members)
        inverse.append(M, 1.0 / size, taken_in, -1, D)
        if len(gone) or len(taken_in):
            self._dependent = np.zeros(0, np.int64)
        left_out = np.setdiff1d(changed[~returned], np.concatenate([inverse.members, self._dependent]))
        inverse.append(M, size, left_out, 1, D)
        self._dependent = np.setdiff1d(changed, inverse.members)

    def _force_of_rigid_motions(self) -> float:
        """Return `rounding`. Collective."""
        bodies = zip(self._operators.subdomains, self._operators.dofs, strict=True)
        motions = [s.R[dofs].sum(axis=1) for s, dofs in bodies]
        moved = np.concatenate([np.zeros(0), *(own / (np.abs(own).max(initial=0.0) or 1.0) for own in motions)])
        active = self.reference.active
        jump = scale_rows(active, self._jump_operator.sum(self._operators.B @ moved))
        force = scale_rows(active, self.reference.respond(jump)) / self.stiffness[self._first :][: self._rows]
        return float(self.comm.allreduce(np.abs(force).max(initial=0.0), MPI.MAX))

    def _largest_eigenvalue(self) -> float:
        """|H| of the reference cell, as some steps of the power method find it.  Collective."""
        x = np.cos(np.arange(self._first, self._first + self._rows) ** 2.0)
        norm = 0.0
        for _ in range(NORM_ITERATIONS):
            length = np.sqrt(allreduce_sum(self.comm, np.array([x @ x]))[0])
            if length == 0.0:
                break
            x = self.reference.respond(x / length)
            norm = float(np.sqrt(allreduce_sum(self.comm, np.array([x @ x]))[0]))
        return norm

    def _restricted(self, y: Float, g: Float) -> Float:
        """H g for y = Gamma g_A.  Collective."""
        members = self._inverse.members
        z = scale_rows(self.reference.active, y)
        if len(members):
            rows = self._columns.rows[members]
            outside = 1.0 - self.reference.active
            jumps = gather_rows(self.comm, y + scale_rows(outside, g), self._first, rows)
            c = self._inverse.solve(jumps)
            whole = np.zeros((len(self._columns.rows), *y.shape[1:]))
            whole[members] = c
            z = z - scale_rows(self.reference.active, self._columns.owned @ whole)
            mine = np.flatnonzero((rows >= self._first) & (rows < self._first + self._rows))
            own = rows[mine] - self._first
            taken_in, stretched = outside[own] > 0, self._inverse.added[mine] > 0
            z[own[taken_in]] = -c[mine[taken_in]]
            # Nothing cancels in D c, however soft the spring.
            z[own[stretched]] = scale_rows(self._inverse.added[mine[stretched]], c[mine[stretched]])
        return scale_rows(self._active, z)


def _stiffness_of_rows(jump_operator: JumpOperator, operators: InterfaceOperators) -> Float:
    """(owned rows,) 1 / (B D^-1 B^T + C) of each row.  Collective.

    D is the diagonal of the bodies' stiffness, C the compliance of the springs.
    """
    flexibility = jump_operator.sum(operators.B.power(2) @ (1.0 / operators.body_diagonal))
    return np.asarray(1.0 / (flexibility + operators.springs))
