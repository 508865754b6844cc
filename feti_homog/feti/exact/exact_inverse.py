"""The exact inverse H of the projected dual operator for any active rows, by a reference cell and followed columns.

Let Gamma be the response of a reference cell with active rows A (`reference_cell`), and C the rows that have changed
since: their bonds broke, closed or softened.  `followed_response` updates the columns of C in the present response at
every change.  With these columns, `reference_changes` turns any response of the reference cell into the present one.

When C has more rows than `feti_influence_columns`, the cell in its present state, but with the initial compliance, is
factored as the new reference cell.  The cell is also factored if an update would lose too many digits; columns are
then followed from the new response.
"""

import numpy as np
from petsc4py import PETSc

from feti_homog.feti import thresholds
from feti_homog.feti.decomposition.interface_neighbours import InterfaceNeighbours
from feti_homog.feti.exact.followed_response import FollowedResponse
from feti_homog.feti.exact.reference_cell import BodyTies, ReferenceCell, one_sided_jumps
from feti_homog.feti.exact.reference_changes import ReferenceChanges
from feti_homog.feti.operators.interface_operators import InterfaceOperators
from feti_homog.feti.operators.preconditioners import Preconditioner
from feti_homog.system.parallel import distributed_arrays
from feti_homog.system.runtime import process
from feti_homog.typing import Bool, Float, Int


class ExactInverse(Preconditioner):
    """The preconditioner z = H r; H is the inverse of the projected dual operator on the active rows.

    Attributes:
        neighbours: adjacent interface nodes.
        reference: factored reference cell.
        stiffness: (all rows,) upper bounds on H_ii: stiffness of two nodes and a spring in series, other nodes fixed.
        norm: upper bound of |H|.
        factorizations: number of reference cells factored so far.
        batch: least number of columns that are computed together.
        most_followed: number of columns above which unused columns are dropped, set for the next reference cell.
    """

    is_exact = True
    reference: ReferenceCell

    def __init__(self, operators: InterfaceOperators) -> None:
        """Factor the cell with all bonds intact.  Collective.

        All boundary operators must be dense.  Options: `feti_influence_columns`.  Raises like `ReferenceCell`.
        """
        comm, jump_operator = operators.comm, operators.jump_operator
        is_small = jump_operator.global_rows <= thresholds.NEVER_REFACTORED_ROWS
        max_changes = thresholds.NEVER_REFACTORED_ROWS if is_small else thresholds.INFLUENCE_COLUMNS
        max_changes = PETSc.Options("feti_").getInt("influence_columns", max_changes)
        self.comm, self._operators, self._max_changes = comm, operators, max_changes
        self._first, end = jump_operator.owned
        self._rows = end - self._first
        self._no_answer = np.zeros((self._rows, 0))
        # The stiffness 1 / diag(B D^-1 B^T + C) of every row, with the diagonal D of K and the springs C.
        flexibility = jump_operator.sum(operators.B.power(2) @ (1.0 / operators.body_diagonal))
        self.stiffness = np.concatenate(comm.allgather(1.0 / (flexibility + operators.springs)))
        # K <= n diag(K) for the n displacements of an element; tests measure the bound where bodies meet.
        displacements = max((s.mesh.triangles.shape[1] * s.problem.components for s in operators.subdomains), default=0)
        self.norm = max(comm.allgather(displacements)) * self.stiffness.max(initial=0.0)
        self._one_sided = one_sided_jumps(operators)
        self._ties = BodyTies(comm, jump_operator)
        self.neighbours = InterfaceNeighbours(comm, jump_operator, operators.subdomains)
        self.batch = thresholds.COLUMNS_AT_ONCE * comm.size
        self.most_followed = min(max(thresholds.NEVER_REFACTORED_ROWS, 2 * max_changes), jump_operator.global_rows)
        self.factorizations = 0
        # Active rows and additional compliance of the present state; additional compliance of the next state.
        self._active, self._more = np.ones(self._rows), np.zeros(self._rows)
        self._next = self._more
        self._restart()

    def soften(self, more: Float) -> None:
        """Add `more` (owned rows,) to the intact spring compliance, from the next `activate` on."""
        self._next = more

    def activate(self, active: Float) -> None:
        """Restrict H to rows where `active` (owned rows,) is 1; raises like `ReferenceCell`.  Collective."""
        if not self._follow(active, self._next, thresholds.LEAST_FOLLOWED):
            self._active, self._more = active, self._next
            self._restart()

    def _follow(self, active: Float, more: Float, pivot: float) -> bool:
        """Follow columns to the state `active`, `more`; return False if a pivot is at most `pivot`.  Collective."""
        gain, sign = more * active - self._more * self._active, self._active - active
        places = np.flatnonzero((sign != 0.0) | (gain != 0.0))
        parts = zip(*self.comm.allgather((self._first + places, sign[places], gain[places])), strict=True)
        rows, signs, gains = (np.concatenate(part) for part in parts)
        if not len(rows):
            return True
        self._is_fresh = False
        self._add_columns(rows)
        if not self._followed.follow(rows, signs, gains, pivot):
            return False
        self._active, self._more = active, more
        return True

    def _restart(self) -> None:
        """Factor the cell with tied bodies and initial springs; follow columns to the present state.  Collective."""
        active, more = self._active, self._more
        self._active, self._more = self._ties.tied(active), np.zeros(self._rows)
        self._followed = FollowedResponse(self.comm, self._first, self.stiffness, self._no_answer, self.most_followed)
        self._factor(self._active)
        self._follow(active, more, 0.0)
        self._is_fresh = True

    def _factor(self, active: Float) -> None:
        """Factor the reference cell with the bonds `active` (owned rows,), which must hold all bodies.  Collective."""
        if self.factorizations:
            self.reference.destroy()  # before the new cell takes memory
            process.trim_memory()
        self.reference = ReferenceCell(self._operators, self._one_sided, active)
        self.factorizations += 1
        self._unchanged = FollowedResponse(self.comm, self._first, self.stiffness, self._no_answer, self.most_followed)
        self._answer: Float | None = None
        self._rounding: float | None = None
        # The new reference cell differs from the present cell by ties, which do not count towards the option.
        self._tie_count = len(self._changes().rows)

    @property
    def _rows_with_pins(self) -> Float:
        """Mark active rows and pins (see `followed_response`) by 1, other rows by 0: (owned rows,)."""
        holds, pins = self._active.copy(), self._followed.pins - self._first
        holds[pins[(pins >= 0) & (pins < self._rows)]] = 1.0
        return holds

    def _changes(self) -> ReferenceChanges:
        """Collect the rows that have changed since the reference cell was factored.  Collective."""
        kinds = np.stack([self.reference.active - self._rows_with_pins, self._more * self._active], axis=1)
        places = np.flatnonzero(kinds.any(axis=1))
        parts = zip(*self.comm.allgather((self._first + places, kinds[places])), strict=True)
        return ReferenceChanges(self.comm, self._first, self.reference, self._followed, *map(np.concatenate, parts))

    def _up_to_date(self) -> ReferenceChanges:
        """Collect the changed rows; if there are too many, first factor a new reference cell.  Collective."""
        changes = self._changes()
        if len(changes.rows) - self._tie_count <= self._max_changes:
            return changes
        tied = self._ties.tied(self._rows_with_pins)
        # Broken ties are changes of the new cell, too.
        rows = np.concatenate(self.comm.allgather(self._first + np.flatnonzero(tied != self._rows_with_pins)))
        self._add(self._followed.lacking(rows), changes, rows)
        self._factor(tied)
        return self._changes()

    def _add_columns(self, rows: Int) -> None:
        """Follow missing columns at global rows (k,) and pins; factor the cell anew if digits are lost.  Collective."""
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
        """Follow columns at global `rows`; columns at `needed` rows stay.  Collective.

        Returns False, and follows none, if `ReferenceChanges.error` of the columns exceeds `max_error`.
        """
        if not len(rows):
            return True
        columns = changes.present(self.reference.columns(rows))
        if not changes.error(rows, columns, self.stiffness) <= max_error:
            return False
        self._followed.make_room(len(rows), np.union1d(needed, changes.rows), self._are_active)
        self._followed.add(rows, columns)
        return True

    def _with_near(self, rows: Int, followed: FollowedResponse) -> Int:
        """Select rows without columns: the global `rows` (k,), and active rows nearby up to a full batch.  Collective.

        Neighbours of broken bonds break next, and columns are cheaper together.  Only active `rows` add rows nearby.
        """
        rows, active = followed.lacking(rows), self._are_active
        enough = self.batch if active[rows].any() else 0
        return self.neighbours.rows_near(rows, lambda near: followed.lacking(near[active[near]]), enough)

    @property
    def _are_active(self) -> Bool:
        """Gather the mask (all rows,) of active rows.  Collective."""
        return np.asarray(np.concatenate(self.comm.allgather(self._active)) > 0.0)

    @property
    def rounding(self) -> float:
        """Return the relative rounding error of the reference cell's H.  Collective when first read for this cell.

        Jumps of unit rigid-body motions cause no forces: the error is the largest H r / `stiffness` of such jumps r.
        """
        if self._rounding is None:
            stiffness = self.stiffness[self._first : self._first + self._rows]
            self._rounding = self.reference.force_of_rigid_motions(stiffness)
        return self._rounding

    def apply(self, r: Float) -> Float:
        """Compute H r for r (owned rows,) or (owned rows, k), 0 on inactive rows; may factor the cell.  Collective."""
        z = self._up_to_date().refined(self._of_reference(r if r.ndim == 2 else r[:, None]))
        return distributed_arrays.scale_rows(self._active, z.reshape(r.shape))

    def _of_reference(self, g: Float) -> Float:
        """Compute the reference response Gamma g_A + g_I to g (owned rows, k), A active, I inactive.  Collective."""
        inactive = distributed_arrays.scale_rows(1.0 - self.reference.active, g)
        return self.reference.respond(distributed_arrays.scale_rows(self.reference.active, g)) + inactive

    def multipliers(self, d: Float, E: Float) -> Float:
        """Compute multipliers H d E (owned rows, k) for loads E (v, k) and `d` as in `renew_answer`.  Collective."""
        return distributed_arrays.scale_rows(self._active, self.renew_answer(d) @ E)

    def answer(self, d: Float, E: Float, free: int = 0) -> tuple[Float, Float] | None:
        """Return multipliers H d E and jumps on inactive rows, both (owned rows, k).  Collective.

        Arguments are as in `multipliers`; `free` is the number of free rigid motions.  Free bodies have one of their
        possible positions.  If the number of pins is not `free`, returns None, and factors a changed cell anew.
        """
        if len(self._followed.pins) != free:
            if not self._is_fresh:
                self._restart()
            return None
        has_digits = self._followed.rounding <= thresholds.MOST_FOLLOWED_ERROR
        U = (self._followed.answer if self._followed.answer.shape[1] and has_digits else self.renew_answer(d)) @ E
        lam = distributed_arrays.scale_rows(self._active, U)
        return lam, U - lam

    def renew_answer(self, d: Float) -> Float:
        """Compute the answer U to unit loads (owned rows, v) anew; store and return U.  Collective.

        U has multipliers on active rows and jumps on inactive rows, from the reference cell's response to `d` (owned
        rows, v), the same in all calls: jumps of the torn cell under unit loads.  Rounding of earlier updates is gone.
        """
        changes = self._up_to_date()
        if self._answer is None:
            self._answer = self._of_reference(d)
        # U is 0 on pins, which bear no force and do not move.
        mask = 1.0 - self._rows_with_pins + self._active
        U = distributed_arrays.scale_rows(mask, changes.refined(self._answer))
        self._followed.answer, self._followed.rounding = U, 0.0
        return U

    def inverse_blocks(self, pairs: Int) -> Float:
        """Compute the diagonal blocks (m, 2, 2) of H at row pairs (m, 2).  Collective.

        All ranks pass equal pairs of active global rows.  If both rows of a pair i open, they part by H_ii^-1 lam_i.
        """
        self._add_columns(np.unique(pairs))
        return self._followed.blocks(pairs)

    def columns(self, rows: Int) -> tuple[Float, Float]:
        """Return columns of Gamma, the reference cell's response, at global rows (k,).  Collective.

        The columns are (owned rows, k), followed by their entries (k, k) at `rows`.  Before the first `activate`, the
        reference cell is the bonded cell, and Gamma is H.
        """
        if len(self._unchanged.lacking(rows)):
            missing = self._with_near(rows, self._unchanged)
            self._unchanged.make_room(len(missing), rows, np.ones(len(self.stiffness), bool))
            self._unchanged.add(missing, self.reference.columns(missing))
        return self._unchanged.columns(rows), self._unchanged.entries(rows, rows)
