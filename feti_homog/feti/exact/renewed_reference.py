"""The reference cell of a state of the bonds, and the next ones, which take its place where many rows have changed.

A new one costs its factor: it is made in parts, between which the bonds go on to break, so that no event pays all.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from mpi4py import MPI

from feti_homog.feti.decomposition.jump_operator import JumpOperator
from feti_homog.feti.decomposition.neighbours import InterfaceNeighbours
from feti_homog.feti.exact.changed_reference import ChangedReference
from feti_homog.feti.exact.followed_changes import FollowedChanges
from feti_homog.feti.exact.followed_response import FollowedResponse
from feti_homog.feti.exact.reference_cell import BodyTies, ReferenceCell, one_sided_jumps, stiffness_of_rows
from feti_homog.feti.operators.interface_operators import InterfaceOperators
from feti_homog.feti.preconditioners.assembled_schur import AssembledSchur, assembled_stiffness
from feti_homog.feti.thresholds import INFLUENCE_BATCH, LATEST_RENEWAL, LEAST_BATCH_SHARE, RENEWAL_PAUSE, SPARE_BYTES
from feti_homog.system.parallel.distributed_arrays import gather_rows
from feti_homog.system.runtime import process_memory
from feti_homog.typing import Bool, Float, Int


class RenewedReference:
    """The reference cell with columns of its response, beside the present state of the bonds.

    Attributes:
        neighbours: which bonds lie beside each other.
        stiffness: (all rows,) the most that each diagonal entry of H can be: that of a node of either side and of the
            spring between them, in a row, while all others are held.
        factorizations: reference cells so far.
        batch: columns found at once at least, as long as most of them are used.
        pause: changes of the bonds from one part of the next reference cell to the next.
        slack: changed rows above `most` with which it is made at once.
    """

    _changes: ChangedReference

    def __init__(
        self, comm: MPI.Intracomm, jump_operator: JumpOperator, operators: InterfaceOperators, most: int
    ) -> None:
        """Factor the cell with all bonds intact, the reference until over `most` rows have changed.  Collective."""
        self.comm, self._jump_operator, self._operators, self._most_columns = comm, jump_operator, operators, most
        self._first, end = jump_operator.owned
        self._rows = end - self._first
        self.stiffness = np.concatenate(comm.allgather(stiffness_of_rows(jump_operator, operators)))
        self._BD = one_sided_jumps(comm, jump_operator, operators)
        self._ties = BodyTies(comm, jump_operator)
        self.neighbours = InterfaceNeighbours(comm, jump_operator, operators.subdomains)
        self.batch, self.pause, self.slack = INFLUENCE_BATCH * comm.size, RENEWAL_PAUSE, most // LATEST_RENEWAL
        self._share = 1.0
        # Columns without which the reference cell is not the one at hand.
        self.factorizations = self._tied = 0
        # The present state; `_held` has the pins of free bodies, too.
        self._held = self._active = np.ones(self._rows)
        self._more = np.zeros(self._rows)
        self._answer: Float | None = None
        self._followed: FollowedResponse | None = None
        # N is of a state before; parts of the next reference cell that wait.
        self._is_behind = False
        self._renewal: Iterator[None] | None = None
        self._left = 0
        self._rebase()

    @property
    def reference(self) -> ReferenceCell:
        """The reference cell."""
        return self._changes.cell

    def _changed(self, held: Float) -> Int:
        """Return the global rows that are `held` here or in the reference cell, not both, and those that softened.

        Collective."""
        own = self._first + np.flatnonzero((held != self.reference.active) | (self._softened > 0.0))
        return np.concatenate(self.comm.allgather(own))

    def _followed_changes(self) -> FollowedChanges | None:
        """Return the rows that have changed, if all of them have followed columns.  Collective."""
        if self._followed is None:
            return None
        rows = self._changed(self._held)
        if len(self._followed.lacking(rows)):
            return None
        kinds = np.stack([self.reference.active - self._held, self._more * self._active], axis=1)
        kinds = gather_rows(self.comm, kinds, self._first, rows)
        return FollowedChanges(self.comm, self._first, self.reference, self._followed, rows, kinds)

    @property
    def _softened(self) -> Float:
        """(owned rows,) D: of springs that softened 1 / dC, or -dC where they came; 0 of all others."""
        holds, came = self._held * self.reference.active > 0.0, self._held > self.reference.active
        more = self._more * self._active
        return np.divide(1.0, more, out=-more * came, where=holds & (more > 0.0))

    def _renew_if_due(self) -> None:
        """Renew the reference cell at once where nothing is followed or it is late, else in parts.  Collective."""
        more = len(self._changed(self._held)) - self._tied - self._most_columns
        if more > 0 and (self._followed is None or more > self.slack):
            self._rebase()
        elif more > 0 and self._renewal is None:
            self._renewal = self._renewed()

    def _renew_a_part(self) -> None:
        """Make a part of the next reference cell, if that has begun and enough calls have passed.  Collective."""
        if self._renewal is None:
            return
        self._left = (self._left or self.pause) - 1
        if not self._left and next(self._renewal, True):
            self._renewal = None

    def _rebase(self) -> None:
        """Take the present cell, and what it takes to hold its bodies, for the reference at once.  Collective."""
        self._renewal = None
        for _ in self._renewed():
            pass

    def _renewed(self) -> Iterator[None]:
        """Make the next reference cell in parts, between which the cell may change: no event pays all.  Collective."""
        tied = self._ties.tied(held := self._held)
        parts = yield from assembled_stiffness(self.comm, self._jump_operator, self._operators, tied)
        yield
        if self.factorizations:
            self._changes.destroy()  # before the new cell takes memory
        assembled = AssembledSchur(self.comm, *parts)
        del parts
        process_memory.trim(kept=SPARE_BYTES)
        cell = ReferenceCell(self.comm, self._jump_operator, self._operators, self._BD, tied, assembled)
        self.factorizations += 1
        self._changes = ChangedReference(self.comm, cell, self._jump_operator.owned, self.stiffness)
        self._answer, self._is_behind = None, True
        self._tied = len(self._changed(held))
        yield
        self._rounding = cell.force_of_rigid_motions(self.stiffness[self._first :][: self._rows])
        if self._followed is not None:
            useful = np.concatenate(self.comm.allgather(self._held)) > 0.0
            useful[self._changed(self._held)] = True
            self._followed.keep(useful)

    def _find(self, rows: Int) -> None:
        """Find the columns of the reference cell that these rows lack, and some near them.  Collective."""
        found = self._changes.columns
        if len(lacking := rows[found.positions(rows) < 0]):
            found.add(self._with_near(lacking, lambda near: near[found.positions(near) < 0]))

    def _with_near(self, rows: Int, lacking: Callable[[Int], Int]) -> Int:
        """Return rows and active ones near them, which break next: columns are cheaper together.  Collective.

        Where only rows lack that have left, none: faces touch here and there.
        """
        is_active = self._is_active()
        most = int(self._share * self.batch) if is_active[rows].any() else 0
        return self.neighbours.rows_near(rows, lambda near: lacking(near[is_active[near]]), most)

    def _adapt_batch(self, was_used: Bool) -> None:
        """Find fewer columns at once where most of those that made room were never used, more where most were."""
        if len(was_used):
            self._share = float(np.clip(self._share * (2.0 if was_used.mean() > 0.5 else 0.5), LEAST_BATCH_SHARE, 1.0))

    def _is_active(self) -> Bool:
        """(all rows,) which are active.  Collective."""
        return np.asarray(np.concatenate(self.comm.allgather(self._active)) > 0.0)
