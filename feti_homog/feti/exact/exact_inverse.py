"""The inverse H of the projected dual operator, exact for any active rows, by a reference cell and followed columns.

Let Gamma be the response of a cell whose active rows are A, `reference_cell`, and C the rows that have changed since:
some of A have left, others have come or their springs gained compliance.  The columns of C in the present response,
which `followed_response` keeps up, turn any other response of the reference cell into the present one
(`reference_changes`), new columns among them.

The reference cell stays until there are more changes than an option allows: then the cell as it stands, but for gains
of compliance, is factored in its place.  Where changes cannot be followed, for they lose too many digits, it is
factored too, and its response is followed from there.
"""

import numpy as np
from petsc4py import PETSc

from feti_homog.errors import CaseError
from feti_homog.feti import thresholds
from feti_homog.feti.decomposition.interface_neighbours import InterfaceNeighbours
from feti_homog.feti.exact.followed_response import FollowedResponse
from feti_homog.feti.exact.reference_cell import BodyTies, ReferenceCell, one_sided_jumps, stiffness_of_rows
from feti_homog.feti.exact.reference_changes import ReferenceChanges
from feti_homog.feti.operators.interface_operators import InterfaceOperators
from feti_homog.feti.operators.preconditioners import Preconditioner
from feti_homog.system.parallel import distributed_arrays
from feti_homog.system.runtime import process_memory
from feti_homog.typing import Bool, Float, Int


class ExactInverse(Preconditioner):
    """The preconditioner z = H r, H the inverse of the dual operator on the active rows.

    Attributes:
        neighbours: which bonds lie beside each other.
        stiffness: (all rows,) bounds for the diagonal of H: the stiffness of both nodes and the spring between them,
            in a row, while all others are held.
        norm: bound of |H|.
        factorizations: reference cells so far.
        batch: least number of columns that are computed together.
        most_followed: number of columns from which unused columns are dropped; a change holds from the next restart.
    """

    is_exact = True
    reference: ReferenceCell

    def __init__(self, operators: InterfaceOperators) -> None:
        """Factor the cell with all bonds intact; all boundary operators must be dense.  Collective.

        Options: `feti_influence_columns`.

        Raises:
            CaseError: the option has no such value.
        """
        comm, jump_operator = operators.comm, operators.jump_operator
        is_small = jump_operator.global_rows <= thresholds.NEVER_REFACTORED_ROWS
        max_changes = thresholds.NEVER_REFACTORED_ROWS if is_small else thresholds.INFLUENCE_COLUMNS
        max_changes = PETSc.Options("feti_").getInt("influence_columns", max_changes)
        if max_changes < 1:
            raise CaseError(f"-feti_influence_columns {max_changes}: expected a whole number above 0")
        self.comm, self._operators, self._max_changes = comm, operators, max_changes
        self._first, end = jump_operator.owned
        self._rows = end - self._first
        self.stiffness = np.concatenate(comm.allgather(stiffness_of_rows(operators)))
        # K <= n diag(K) for the n displacements of an element; tests measure the bound where bodies meet.
        displacements = max((s.mesh.triangles.shape[1] * s.problem.components for s in operators.subdomains), default=0)
        self.norm = max(comm.allgather(displacements)) * self.stiffness.max(initial=0.0)
        self._one_sided = one_sided_jumps(operators)
        self._ties = BodyTies(comm, jump_operator)
        self.neighbours = InterfaceNeighbours(comm, jump_operator, operators.subdomains)
        self.batch = thresholds.COLUMNS_AT_ONCE * comm.size
        self.most_followed = min(max(thresholds.NEVER_REFACTORED_ROWS, 2 * max_changes), jump_operator.global_rows)
        self.factorizations = 0
        # Of the present state active rows and what springs gained; the latter from the next `activate` on.
        self._active, self._more = np.ones(self._rows), np.zeros(self._rows)
        self._next = self._more
        self._restart()

    def soften(self, more: Float) -> None:
        """Add `more` compliance (owned rows,) to the initial one, from the next `activate` on."""
        self._next = more

    def activate(self, active: Float) -> None:
        """Restrict to the rows where `active` is 1.  Collective."""
        if not self._follow(active, self._next, thresholds.LEAST_FOLLOWED):
            self._active, self._more = active, self._next
            self._restart()

    def _follow(self, active: Float, more: Float, pivot: float) -> bool:
        """Follow rows that leave, come or soften; return False if a pivot is below `pivot`.  Collective."""
        gained, turned = more * active - self._more * self._active, self._active - active
        places = np.flatnonzero((turned != 0.0) | (gained != 0.0))
        parts = zip(*self.comm.allgather((self._first + places, turned[places], gained[places])), strict=True)
        rows, turns, gains = (np.concatenate(part) for part in parts)
        if not len(rows):
            return True
        self._is_fresh = False
        self._add_columns(rows)
        if not self._followed.follow(rows, turns, gains, pivot):
            return False
        self._active, self._more = active, more
        return True

    def _restart(self) -> None:
        """Factor the cell in its present state, and follow its response from there.  Collective."""
        active, more = self._active, self._more
        self._active, self._more = self._ties.tied(active), np.zeros(self._rows)
        nothing = np.zeros((self._rows, 0))
        self._followed = FollowedResponse(self.comm, self._first, self.stiffness, nothing, self.most_followed)
        self._factor(self._active)
        self._follow(active, more, 0.0)
        self._is_fresh = True

    def _factor(self, active: Float) -> None:
        """Factor the reference cell with the bonds `active`, which must hold all bodies.  Collective."""
        if self.factorizations:
            self.reference.destroy()  # before the new cell takes memory
            process_memory.trim()
        self.reference = ReferenceCell(self._operators, self._one_sided, active)
        self.factorizations += 1
        self._unchanged = FollowedResponse(
            self.comm, self._first, self.stiffness, np.zeros((self._rows, 0)), self.most_followed
        )
        self._answer: Float | None = None
        self._rounding: float | None = None
        # Changes without which the reference cell is not the one at hand.
        self._tied = len(self._changes().rows)

    @property
    def _held(self) -> Float:
        """(owned rows,) 1 on active rows and on pins."""
        holds, pins = self._active.copy(), self._followed.pins - self._first
        holds[pins[(pins >= 0) & (pins < self._rows)]] = 1.0
        return holds

    def _changes(self) -> ReferenceChanges:
        """Return the changes since the reference cell.  Collective."""
        kinds = np.stack([self.reference.active - self._held, self._more * self._active], axis=1)
        places = np.flatnonzero(kinds.any(axis=1))
        parts = zip(*self.comm.allgather((self._first + places, kinds[places])), strict=True)
        return ReferenceChanges(self.comm, self._first, self.reference, self._followed, *map(np.concatenate, parts))

    def _up_to_date(self) -> ReferenceChanges:
        """Return the changes since the reference cell; factor this cell anew if they are too many.  Collective."""
        changes = self._changes()
        if len(changes.rows) - self._tied <= self._max_changes:
            return changes
        tied = self._ties.tied(self._held)
        # Ties that have left are changes of the new cell, too.
        rows = np.concatenate(self.comm.allgather(self._first + np.flatnonzero(tied != self._held)))
        self._add(self._followed.lacking(rows), changes, rows)
        self._factor(tied)
        return self._changes()

    def _add_columns(self, rows: Int) -> None:
        """Compute the missing columns of the present response for global rows (k,) and pins.  Collective."""
        rows = np.union1d(rows, self._followed.pins)
        if not len(self._followed.lacking(rows)):
            return
        changes = self._up_to_date()
        if not self._add(self._with_near(rows, self._followed), changes, rows):
            self._restart()
            rows = np.union1d(rows, self._followed.pins)
            self._add(self._followed.lacking(rows), self._changes(), rows, np.inf)

    def _add(
        self, rows: Int, changes: ReferenceChanges, needed: Int, max_error: float = thresholds.MOST_ROUNDING
    ) -> bool:
        """Follow new columns of global rows (k,), unless they are asymmetric with followed columns.  Collective."""
        if not len(rows):
            return True
        columns = changes.present(self.reference.columns(rows))
        if not changes.error(rows, columns, self.stiffness) <= max_error:
            return False
        self._followed.make_room(len(rows), np.union1d(needed, changes.rows), self._are_active)
        self._followed.add(rows, columns)
        return True

    def _with_near(self, rows: Int, followed: FollowedResponse) -> Int:
        """Return the rows without columns, and active rows near them.

        Near bonds break next, and columns are cheaper together.  If all of the rows are inactive, near rows are left
        out.  Collective.
        """
        rows, active = followed.lacking(rows), self._are_active
        enough = self.batch if active[rows].any() else 0
        return self.neighbours.rows_near(rows, lambda some: followed.lacking(some[active[some]]), enough)

    @property
    def _are_active(self) -> Bool:
        """Whether each row is active (all rows,).  Collective."""
        return np.asarray(np.concatenate(self.comm.allgather(self._active)) > 0.0)

    @property
    def rounding(self) -> float:
        """Relative error of H: the largest force by jumps of unit rigid-body motions, over `stiffness`.

        Bodies follow rigid-body motions without force, so that all of this force is rounding.  Collective.
        """
        if self._rounding is None:
            stiffness = self.stiffness[self._first : self._first + self._rows]
            self._rounding = self.reference.force_of_rigid_motions(stiffness)
        return self._rounding

    def apply(self, r: Float) -> Float:
        """H r for r (owned rows,) or (owned rows, k); 0 on inactive rows.  Collective."""
        z = self._up_to_date().refined(self._of_reference(r if r.ndim == 2 else r[:, None]))
        return distributed_arrays.scale_rows(self._active, z.reshape(r.shape))

    def _of_reference(self, g: Float) -> Float:
        """Compute Gamma g_A + g_R (owned rows, k): jumps g_R on inactive rows stay.  Collective."""
        at_rest = distributed_arrays.scale_rows(1.0 - self.reference.active, g)
        return self.reference.respond(distributed_arrays.scale_rows(self.reference.active, g)) + at_rest

    def multipliers(self, d: Float, E: Float) -> Float:
        """Compute H d E (owned rows, k) for E (v, k).  All calls must pass the same d (owned rows, v).  Collective."""
        return distributed_arrays.scale_rows(self._active, self.renew_answer(d) @ E)

    def answer(self, d: Float, E: Float, free: int = 0) -> tuple[Float, Float] | None:
        """Return H d E and the jumps on inactive rows, (owned rows, k) each, updated from state to state.

        Arguments as in `multipliers`.  Jumps hold for one position of free bodies.  Return None if these have another
        number of motions than `free`.  Collective.
        """
        if len(self._followed.pins) != free:
            if not self._is_fresh:
                self._restart()
            return None
        is_exact = self._followed.answer.shape[1] and not self._followed.had_pins
        U = (self._followed.answer if is_exact else self.renew_answer(d)) @ E
        lam = distributed_arrays.scale_rows(self._active, U)
        return lam, U - lam

    def renew_answer(self, d: Float) -> Float:
        """Compute U (owned rows, v) for d (owned rows, v) without rounding of the updates, and update this one.

        Collective.
        """
        changes = self._up_to_date()
        if self._answer is None:
            self._answer = self._of_reference(d)
        # Pins bear nothing, and stay.
        self._followed.answer = distributed_arrays.scale_rows(
            1.0 - self._held + self._active, changes.refined(self._answer)
        )
        return self._followed.answer

    def inverse_blocks(self, pairs: Int) -> Float:
        """Return the diagonal blocks (m, 2, 2) of H for pairs (m, 2) of active global rows.  Collective.

        All ranks pass the same pairs.  Rows i that leave together open by H_ii^-1 lam_i.
        """
        self._add_columns(np.unique(pairs))
        return self._followed.blocks(pairs)

    def columns(self, rows: Int) -> tuple[Float, Float]:
        """Return columns (owned rows, k) of H in the reference cell, and their (k, k) block, for global rows (k,).

        Before the first `activate` the reference cell is the bonded cell.  Collective.
        """
        if len(self._unchanged.lacking(rows)):
            new = self._with_near(rows, self._unchanged)
            self._unchanged.make_room(len(new), rows, np.ones(len(self.stiffness), bool))
            self._unchanged.add(new, self.reference.columns(new))
        return self._unchanged.columns(rows), self._unchanged.entries(rows, rows)
