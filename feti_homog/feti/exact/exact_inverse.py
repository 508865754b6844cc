"""The inverse H of the projected dual operator, exact for any active rows, by columns of a reference cell.

Let Gamma be the response of a cell whose active rows are A, `reference_cell`, and C the rows that are active either
here or there: D of A have left, R beside A have come.  The multipliers that close the jumps g are

    y = Gamma_:A g_A,  c = N (y_C + g_R),  lam_A = y_A - Gamma_AC c,  lam_R = -c_R,  N = Gamma_CC^-1.

A spring whose compliance grew by dC is one of C, whose jump dC lam is prescribed by its own multiplier:

    N = (Gamma_CC + D)^-1,  lam_C = D c on such rows,  D = dC^-1 there, -dC where bonds came, 0 where they left.

Changes cost their columns of what `followed_response` keeps up, which gives new ones, too (`followed_changes`).  N
follows the changes, by borders, where these columns are not at hand.  The reference cell stays, until there are more
changes than an option allows: then the cell as it stands, but for what softened, takes its place, see
`renewed_reference`.
"""

from __future__ import annotations

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from feti_homog.errors import CaseError
from feti_homog.feti.decomposition.jump_operator import JumpOperator
from feti_homog.feti.exact.followed_changes import FollowedChanges
from feti_homog.feti.exact.followed_response import FollowedResponse
from feti_homog.feti.exact.renewed_reference import RenewedReference
from feti_homog.feti.operators.interface_operators import InterfaceOperators
from feti_homog.feti.preconditioners.scaled import Preconditioner
from feti_homog.feti.thresholds import (
    FOLLOWED_COLUMNS,
    INFLUENCE_COLUMNS,
    MOST_ASYMMETRY,
    MOST_FOLLOWED,
    NEVER_REFACTORED_ROWS,
    NORM_MARGIN,
)
from feti_homog.system.parallel.distributed_arrays import gather_rows, scale_rows
from feti_homog.typing import Float, Int


class ExactInverse(RenewedReference, Preconditioner):
    """z = H r on the active rows, H the inverse of the dual operator there: nothing is left to iterate.

    Attributes:
        norm: |H| with all bonds intact, which is the largest, as the power method finds it, with a margin.
        most_followed: columns at most that are followed, from the next time that none are.
    """

    norm: float = np.inf
    is_exact = True

    def __init__(self, comm: MPI.Intracomm, jump_operator: JumpOperator, operators: InterfaceOperators) -> None:
        """Factor the cell with all bonds intact; all boundary operators must be dense.  Collective.

        Options: `feti_influence_columns`.

        Raises:
            CaseError: the option has no such value.
        """
        most = NEVER_REFACTORED_ROWS if jump_operator.global_rows <= NEVER_REFACTORED_ROWS else INFLUENCE_COLUMNS
        most = PETSc.Options("feti_").getInt("influence_columns", most)
        if most < 1:
            raise CaseError(f"-feti_influence_columns {most}: expected a whole number above 0")
        super().__init__(comm, jump_operator, operators, most)
        self.most_followed = min(max(FOLLOWED_COLUMNS, 2 * most), jump_operator.global_rows)
        self._has_added = False
        self._next, self._loose = self._more, np.zeros(0, np.int64)
        # Rows that leave make H smaller.
        self.norm = NORM_MARGIN * self.reference.largest_eigenvalue(self._first)

    @property
    def rounding(self) -> float:
        """Return the largest force, relative to `stiffness`, that jumps of rigid-body motions of size 1 make.

        Bodies follow them without force: all of it is rounding, a relative error of H.  Collective."""
        if self._followed is None:
            self._catch_up()
        return self._rounding

    def soften(self, more: Float) -> None:
        """Let springs have `more` compliance (owned rows,) than at first, from the next `activate` on."""
        self._next = more

    def activate(self, active: Float) -> None:
        """Restrict to the rows where `active` is 1.  Collective."""
        self._has_added = False
        if self._followed is not None and not self._follow(self._followed, active):
            self._followed = None
        self._active, self._more, self._is_behind = active, self._next, True
        self._held = active if self._followed is None else self._with_pins(self._followed.pins, active)
        # Columns cost as much as a part of the next reference cell.
        if self._followed is not None and not self._has_added:
            self._renew_a_part()

    def _follow(self, followed: FollowedResponse, active: Float) -> bool:
        """Keep what is followed up with the rows that soften, leave or come, if it can be.  Collective."""
        gained = self._next * active - self._more * self._active
        own = np.flatnonzero(((turned := self._active - active) != 0.0) | (gained != 0.0))
        parts = zip(*self.comm.allgather((self._first + own, turned[own], gained[own])), strict=True)
        rows, *numbers = (np.concatenate(part) for part in parts)
        is_few = len(rows) <= MOST_FOLLOWED
        return is_few and self._add_followed(followed, rows) and followed.follow(rows, *numbers)

    def _with_pins(self, pins: Int, active: Float) -> Float:
        """(owned rows,) 1 on active rows and on the global rows `pins`."""
        held = active.copy()
        held[pins[(pins >= self._first) & (pins < self._first + self._rows)] - self._first] = 1.0
        return held

    def _add_followed(self, followed: FollowedResponse, wanted: Int) -> bool:
        """Let all rows (k,) `wanted` and the pins have columns of the present response; False if that cannot be.

        Collective.
        """
        wanted = np.union1d(wanted, followed.pins) if len(followed.pins) else wanted
        if not len(followed.lacking(wanted)):
            return True
        self._has_added = True
        changes = self._up_to_date()
        if (changes is None and self._has_others(followed)) or len(wanted) > followed.most:
            return False  # other bodies are free than those with pins, or there is no room
        near = self._with_near(lacking := followed.lacking(wanted), followed.lacking)
        rows = near if len(np.union1d(wanted, near)) <= followed.most else lacking
        if changes is None:
            self._changes.columns.add(rows)
            columns = self._changes.present(rows, self._held)
        else:
            columns = changes.present(self._changes.columns.found(rows))
            if not changes.error(rows, columns, self.stiffness) <= MOST_ASYMMETRY:
                self._forget()
                return False
        # Without columns of what has changed, N is wanted.
        spared = np.union1d(wanted, self._changed(self._held) if changes is None else changes.rows)
        spared = spared if len(np.union1d(spared, rows)) <= followed.most else wanted
        self._adapt_batch(followed.make_room(len(rows), spared, self._is_active()))
        followed.add(rows, columns)
        return True

    def _up_to_date(self) -> FollowedChanges | None:
        """Return the changes of the reference cell if all are followed, else None with N up to date.  Collective."""
        self._renew_if_due()
        if (changes := self._followed_changes()) is None:
            self._catch_up()
        return changes

    def _catch_up(self) -> None:
        """Let the reference cell and N be those of the present state.  Collective."""
        if not self._is_behind:
            return
        self._renew_if_due()
        self._is_behind = False
        changed = self._changed(self._held)
        self._find(changed)
        self._changes.update(changed, self._softened)
        self._loose = self._changes.columns.rows[self._changes.inverse.dependent]
        self._held = self._with_pins(self._loose, self._held)

    def _has_others(self, followed: FollowedResponse) -> bool:
        """Return whether N finds other bodies free than those with pins."""
        return not np.isin(self._loose, followed.pins).all()

    def apply(self, r: Float) -> Float:
        """H r for r (owned rows,) or (owned rows, k); 0 on inactive rows.  Collective."""
        changes = self._up_to_date()
        z = self._of_reference(r if r.ndim == 2 else r[:, None])
        found = self._changes.response(z) if changes is None else changes.refined(z)
        return scale_rows(self._active, found.reshape(r.shape))

    def _of_reference(self, g: Float) -> Float:
        """(owned rows, k) Gamma g_A + g_R.  Collective."""
        at_rest = scale_rows(1.0 - self.reference.active, g)
        return self.reference.respond(scale_rows(self.reference.active, g)) + at_rest

    def multipliers(self, d: Float, E: Float) -> Float:
        """H d E, but for rounding, for d (owned rows, v), the same at every call, and E (v, k).  Collective."""
        return scale_rows(self._active, self._whole_answer(d) @ E)

    def answer(self, d: Float, E: Float, free: int = 0) -> tuple[Float, Float] | None:
        """Multipliers H d E and jumps on inactive rows, (owned rows, k), with arguments as of `multipliers`.

        They are those of before with updates, where these can be followed.  Jumps are those of one place of the bodies
        that nothing holds; None where these have another number of motions than `free`.  Collective.
        """
        whole = (self._whole_answer(d) if self._followed is None else self._followed.answer) @ E
        if self._followed is None or len(self._followed.pins) != free:
            self._forget()
            return None
        lam = scale_rows(self._active, whole)
        return lam, whole - lam

    def renew_answer(self, d: Float) -> None:
        """Let what is followed of the multipliers H d, of d (owned rows, v), be without rounding of the updates.

        Collective."""
        self._whole_answer(d)

    def _forget(self) -> None:
        """Follow nothing, so that pins are found anew."""
        self._followed, self._held, self._is_behind = None, self._active, True

    def _whole_answer(self, d: Float) -> Float:
        """(owned rows, v) U, from which updates go on.  Collective."""
        changes = self._up_to_date()
        if changes is None and self._followed is not None and self._has_others(self._followed):
            self._forget()
            self._catch_up()
        if self._answer is None:
            self._answer = self._of_reference(d)
        answer = self._changes.response(self._answer) if changes is None else changes.refined(self._answer)
        # Pins bear nothing, and stay.
        answer = scale_rows(1.0 - self._held + self._active, answer)
        if self._followed is None:
            arguments = self.stiffness, answer, self._loose, self.most_followed
            self._followed = FollowedResponse(self.comm, self._first, *arguments)
        self._followed.answer = answer
        return answer

    def inverse_blocks(self, pairs: Int) -> Float:
        """(m, 2, 2) diagonal blocks of H, for the same pairs (m, 2) of active global rows on every rank.  Collective.

        Rows that leave together change the multipliers of their own by all of them, and open by H_ii^-1 lam_i.
        """
        if (followed := self._followed) is not None and self._add_followed(followed, np.unique(pairs)):
            return followed.blocks(pairs)
        self._catch_up()
        self._find(pairs.ravel())
        returned = gather_rows(self.comm, self.reference.active, self._first, pairs.ravel()) == 0
        found = self._changes.columns
        return self._changes.inverse.blocks(found.block, found.positions(pairs.ravel()), returned)

    def columns(self, rows: Int) -> tuple[Float, Float]:
        """(owned rows, k) columns of H of the reference cell, and their (k, k) block, for the same global rows (k,).

        They are those of the bonded cell until rows are first restricted.  Collective.
        """
        self._find(rows)
        at = self._changes.columns.positions(rows)
        return self._changes.columns.owned[:, at], self._changes.columns.block[at[:, None], at]
