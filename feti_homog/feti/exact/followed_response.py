"""The answer U to the unit loads, and columns of the response Gamma, updated as bonds soften, break and close.

U has multipliers on active rows and jumps on inactive rows, under the unit loads.  Gamma maps jumps on active rows and
forces on inactive rows to multipliers and jumps.  U and Gamma are principal pivot transforms.  If springs on the
active rows I gain the compliance dC, U and Gamma become

    U <- U - Gamma_:I B U_I,  Gamma <- Gamma - Gamma_:I B Gamma_I:,  B = (dC^-1 + Gamma_II)^-1.

If the rows I become inactive (s = 1) or active (s = -1), B = Gamma_II^-1 and

    U_I <- s B U_I,  Gamma_I: <- s B Gamma_I:,  Gamma_:I <- Gamma_:I B s,  Gamma_II <- -s B s,

with the other entries as above.  Springs of inactive rows have the initial compliance C_0: Gamma_II loses the gain of
a row that becomes inactive, and receives the gain of a row that becomes active.  An update needs only the columns of
I; changes of the other stored columns are collected, and applied when there are WAITING_COLUMNS of them.

A row that alone resists a motion of a body becomes a pin, not inactive.  A pin stays among the active rows, with
multiplier and jump 0, and fixes one of the possible positions of the body, until another row that resists the motion
becomes active.
"""

import numpy as np
from mpi4py import MPI
from scipy.linalg.blas import dgemm
from scipy.linalg.lapack import dpstrf

from feti_homog.feti import thresholds
from feti_homog.feti.linalg.dense_matrices import product_with_some
from feti_homog.system.parallel import distributed_arrays
from feti_homog.typing import Bool, Float, Int


class FollowedResponse:
    """The answer U to the unit loads, and columns of the response Gamma, in the present state.

    Attributes:
        answer: (owned rows, v) U.
        pins: (p,) global rows of pins, which hold bodies that no active row holds.
        rounding: estimated rounding error of U, relative to its largest entries; 0 when U is new.
    """

    def __init__(self, comm: MPI.Intracomm, first: int, stiffness: Float, answer: Float, capacity: int) -> None:
        """Begin with U = `answer` (owned rows, v) and no columns; the owned rows begin at `first`.

        `stiffness` (all rows,) bounds the diagonal of Gamma on active rows.  Above `capacity` columns, `make_room`
        drops unused columns.
        """
        self._comm, self._first, self._stiffness = comm, first, stiffness
        self.answer, self.pins, self.rounding = answer, np.zeros(0, np.int64), 0.0
        self._slot, self._rows = np.full(len(stiffness), -1), np.zeros(0, np.int64)
        # Number of the change at which every column was last used, and number of the present change.
        self._used, self._now = np.zeros(capacity, np.int64), 0
        # The operating system provides this memory only when columns are written.
        self._buffer = np.zeros((len(answer), capacity), order="F")
        # Waiting changes of the stored columns: columns to subtract, and their factors in every stored column.
        self._waiting = np.zeros((len(answer), thresholds.WAITING_COLUMNS), order="F")
        self._factors = np.zeros((capacity, thresholds.WAITING_COLUMNS))
        self._count = 0

    def lacking(self, rows: Int) -> Int:
        """Return the global `rows` (k,) that have no column."""
        return rows[self._slot[rows] < 0]

    def make_room(self, more: int, needed: Int, useful: Bool) -> None:
        """Make room for `more` columns: if necessary, drop the least recently used columns.

        Columns of rows `needed` stay, even above the capacity; rows in the mask `useful` (all rows,) lose columns last.
        """
        capacity = len(self._used)
        if len(self._rows) + more <= capacity:
            return
        # The remaining columns move, which costs time: so more columns than necessary are dropped at once.
        count = max(min(int(thresholds.FOLLOWED_SHARE * capacity), capacity - more), 0)
        is_needed, is_useful = np.isin(self._rows, needed), useful[self._rows]
        order = np.lexsort([-self._used[: len(self._rows)], ~is_useful, ~is_needed])
        slots = np.sort(order[: max(count, int(is_needed.sum()))])
        rows, n = self._rows[slots], len(slots)
        self._slot[self._rows] = -1
        self._slot[rows] = np.arange(n)
        self._rows, self._used[:n] = rows, self._used[slots]
        for part in np.array_split(np.arange(n), n // thresholds.WAITING_COLUMNS + 1):
            # Columns move to the left, so that no column is overwritten before its move.
            self._buffer[:, part] = self._buffer[:, slots[part]]
        self._factors[:n] = self._factors[slots]
        if n + more > capacity:
            wider = np.zeros((len(self._buffer), 2 * (n + more)), order="F")
            wider[:, :n] = self._buffer[:, :n]
            self._buffer = wider
            new = wider.shape[1] - capacity
            self._used, self._factors = np.pad(self._used, (0, new)), np.pad(self._factors, [(0, new), (0, 0)])

    def columns(self, rows: Int) -> Float:
        """Return the columns (owned rows, k) at global rows (k,), which must have columns."""
        at, n = self._slot[rows], self._count
        return np.asarray(self._buffer[:, at] - self._waiting[:, :n] @ self._factors[at, :n].T)

    def product(self, rows: Int, x: Float) -> Float:
        """Compute Gamma[:, rows] x (owned rows, k) for global `rows` (c,) with columns, and x (c, k)."""
        at, n, columns = self._slot[rows], self._count, len(self._rows)
        waiting = self._waiting[:, :n] @ (self._factors[at, :n].T @ x)
        return product_with_some(self._buffer[:, :columns], at, x) - waiting

    def entries(self, rows: Int, columns: Int) -> Float:
        """Return the entries (k, c) of Gamma at global rows (k,) and columns (c,).  Collective."""
        at, n, places = self._slot[columns], self._count, rows - self._first
        mine = np.flatnonzero((places >= 0) & (places < len(self._buffer)))
        places, entries = places[mine], np.zeros((len(rows), len(columns)))
        entries[mine] = self._buffer[places[:, None], at] - self._waiting[places, :n] @ self._factors[at, :n].T
        return distributed_arrays.allreduce_sum(self._comm, entries)

    def blocks(self, pairs: Int) -> Float:
        """Return the diagonal blocks (m, 2, 2) of Gamma at global row pairs (m, 2).  Collective.

        Both rows of a pair must belong to one rank and have columns, which then count as used at the present change.
        """
        assert not len(self.lacking(pairs))
        places, at, n = pairs - self._first, self._slot[pairs], self._count
        self._used[at] = self._now
        mine = ((places >= 0) & (places < len(self._buffer))).all(axis=1)
        places, at = places[mine], at[mine]
        blocks = np.zeros((len(pairs), 2, 2))
        blocks[mine] = self._buffer[places[:, :, None], at[:, None, :]]
        blocks[mine] -= self._waiting[places, :n] @ self._factors[at, :n].transpose(0, 2, 1)
        return distributed_arrays.allreduce_sum(self._comm, blocks)

    def add(self, rows: Int, columns: Float) -> None:
        """Store the columns (owned rows, k) of global rows (k,); call `make_room` first."""
        self._apply_waiting()
        old, new = len(self._rows), len(self._rows) + len(rows)
        self._slot[rows] = np.arange(old, new)
        self._rows = np.concatenate([self._rows, rows])
        self._buffer[:, old:new], self._used[old:new] = columns, self._now

    def follow(self, rows: Int, signs: Float, gains: Float, pivot: float = thresholds.LEAST_FOLLOWED) -> bool:
        """Update U and the columns for changed rows.  Collective.

        Returns False, with U and Gamma useless, if a scaled pivot is at most `pivot` or too many pins become inactive.

        Args:
            rows: (k,) global numbers; these rows and the pins must have columns.
            signs: (k,) s: 1 for rows that become inactive, -1 for rows that become active, 0 for rows that stay active.
            gains: (k,) gain of spring compliance.
        """
        is_pin = (rows[:, None] == self.pins).any(axis=1)
        if is_pin.any():
            self.pins = np.setdiff1d(self.pins, rows)
        stays = (signs == 0.0) | is_pin
        softer = np.flatnonzero(stays & (gains != 0.0))
        parts = np.array_split(softer, len(softer) // thresholds.WAITING_COLUMNS + 1)
        if not all(self.soften(rows[part], gains[part], pivot) for part in parts if len(part)):
            return False
        # Rows become active first, so that fewer bodies are free in between; half of the room is for pins.
        moves = np.flatnonzero(~stays)
        moves = moves[np.argsort(signs[moves], kind="stable")]
        parts = np.array_split(moves, 2 * len(moves) // thresholds.WAITING_COLUMNS + 1)
        return all(self._turn(rows[part], signs[part], gains[part], pivot) for part in parts if len(part))

    def soften(self, rows: Int, more: Float, pivot: float = 0.0) -> bool:
        """Update U and columns for springs on `rows` (k,) that gain compliance `more`; see `follow`.  Collective."""
        self._make_room_for_waiting(len(rows))
        columns, values = self._present(rows)
        k, root = len(rows), np.sqrt(np.abs(more))
        outer = np.outer(root, root)
        block = np.diag(np.sign(more)) + outer * (values[:k, :k] + values[:k, :k].T) / 2
        # The root broadcasts B, so that all ranks have the same rounding.
        B = self._comm.bcast(np.linalg.inv(block) * outer if _has_digits(block, pivot) else None)
        if B is not None:
            self._change(columns, B, values)
        return B is not None

    def _turn(self, rows: Int, sign: Float, gain: Float, pivot: float) -> bool:
        """Update U and columns for rows that become inactive (sign 1) or active (-1).  Collective.

        Arguments and result are as in `follow`.  Pins on which a new active row exerts a force become inactive.
        """
        columns, values = self._present(rows)
        forces = values[len(rows) :, : len(rows)][:, sign < 0.0]
        is_loaded = (np.abs(forces[self._slot[self.pins]]) > thresholds.LEAST_FOLLOWED).any(axis=1)
        loaded = self.pins[is_loaded]
        if len(loaded):
            rows = np.concatenate([rows, loaded])
            sign, gain = np.append(sign, np.ones(len(loaded))), np.append(gain, np.zeros(len(loaded)))
            columns, values = self._present(rows)
        k = len(rows)
        if k > thresholds.WAITING_COLUMNS:
            return False
        block = (values[:k, :k] + values[:k, :k].T) / 2 - np.diag(np.where(sign < 0.0, gain, 0.0))
        inverse = self._comm.bcast(_regular(block, sign, self._stiffness[rows], pivot))
        if inverse is None:
            return False
        self.answer = self.answer.copy()
        which, B, growth = inverse
        self.rounding += np.finfo(float).eps * growth
        if len(which):
            self._make_room_for_waiting(len(which))
            s, difference, places = sign[which], np.take(columns, which, axis=1), rows[which] - self._first
            mine = np.flatnonzero((places >= 0) & (places < len(columns)))
            places = places[mine]
            new_columns = difference @ (B * s)
            new_columns[places] = -(s[:, None] * B * s + np.diag(np.where(s > 0.0, gain[which], 0.0)))[mine]
            # Rows I become s B U_I and s B Gamma_I: from 0, because differences from their old values lose digits
            # where a stiffness is far from 1.
            self.answer[places], self._buffer[places], self._waiting[places, : self._count] = 0.0, 0.0, 0.0
            difference[places] = -np.diag(s)[mine]
            order = np.concatenate([which, np.arange(k, len(values))])
            self._change(difference, B, np.hstack([values[order][:, which], values[order, k:]]))
            at = self._slot[rows[which]]
            self._buffer[:, at], self._factors[at] = new_columns, 0.0
        if len(loaded) or len(which) < k or len(self.pins):
            loose = np.setdiff1d(np.arange(k), which)
            self.pins = np.union1d(np.setdiff1d(self.pins, loaded), rows[loose])
            places = self.pins - self._first
            self.answer[places[(places >= 0) & (places < len(self.answer))]] = 0.0
            # Springs of pins have C_0, like springs of inactive rows.
            softer = loose[gain[loose] != 0.0]
            if len(softer):
                return self.soften(rows[softer], gain[softer], pivot)
        return True

    def _present(self, rows: Int) -> tuple[Float, Float]:
        """Begin a change; return the columns (owned rows, k) of Gamma at `rows`, which count as used.  Collective.

        Also returns, on all ranks, rows (k + s, k + v) of [columns, U]: `rows`, then the s rows with stored columns.
        """
        self._now += 1
        self._used[self._slot[rows]] = self._now
        columns, everywhere = self.columns(rows), np.concatenate([rows, self._rows])
        values = np.hstack([columns, self.answer])
        return columns, distributed_arrays.gather_rows(self._comm, values, self._first, everywhere)

    def _change(self, difference: Float, B: Float, values: Float) -> None:
        """Subtract `difference` B U_I from U, and let `difference` B Gamma_I wait; `values` are from `_present`."""
        n, k = self._count, len(B)
        self.answer = self.answer - difference @ (B @ values[:k, k:])
        self._waiting[:, n : n + k], self._factors[: len(self._rows), n : n + k] = difference, values[k:, :k] @ B
        self._count += k

    def _make_room_for_waiting(self, k: int) -> None:
        """Make room for `k` waiting columns."""
        if self._count + k > thresholds.WAITING_COLUMNS:
            self._apply_waiting()

    def _apply_waiting(self) -> None:
        """Subtract all waiting changes from the columns."""
        n, k = self._count, len(self._rows)
        if n and k and len(self._buffer):
            # In place: a separate product would take as much memory as all columns.
            waiting, factors = self._waiting[:, :n], self._factors[:k, :n]
            dgemm(-1.0, waiting, factors, beta=1.0, c=self._buffer[:, :k], trans_b=1, overwrite_c=1)
        self._count = 0


def _regular(block: Float, sign: Float, stiffness: Float, pivot: float) -> tuple[Int, Float, float] | None:
    """Invert `block` (k, k) on the rows that can change; return their positions, the inverse and `growth`.

    Rows can always become active (sign -1), and become inactive (1) if no body becomes free.  Rounding grows with
    `growth`, the largest compliance of a row times `stiffness` (k,).  Returns None for scaled pivots up to `pivot`.
    """
    # The units of both kinds of rows differ by the square of a stiffness.
    units = np.where(sign > 0.0, stiffness, 1.0 / stiffness)
    root = np.sqrt(np.maximum(units, np.abs(block.diagonal())))
    outer = np.outer(root, root)
    scaled, which = block / outer, np.arange(len(block))
    if not _has_digits(scaled, thresholds.LEAST_FOLLOWED):
        on, off = np.flatnonzero(sign < 0.0), np.flatnonzero(sign > 0.0)
        if not len(off) or not _has_digits(scaled[on[:, None], on], pivot):
            return None
        across = scaled[on[:, None], off]
        schur = scaled[off[:, None], off] - across.T @ np.linalg.solve(scaled[on[:, None], on], across)
        factor, order, rank, _ = dpstrf(schur, tol=thresholds.ZERO_TOLERANCE, lower=1)
        # LAPACK accepts any first pivot.
        rank = min(rank, int((factor.diagonal() ** 2 > thresholds.ZERO_TOLERANCE).sum()))
        which = np.concatenate([on, off[order[:rank] - 1]])
        if not _has_digits(scaled[which[:, None], which], pivot):
            return None
    B = np.linalg.inv(scaled[which[:, None], which]) / outer[which[:, None], which]
    compliances = np.abs([block.diagonal()[which] / units[which], B.diagonal() * units[which]])
    return which, B, float(compliances.max(initial=1.0))


def _has_digits(block: Float, pivot: float) -> bool:
    """Return whether all singular values of `block` exceed `pivot`."""
    return bool(np.linalg.svd(block, compute_uv=False).min(initial=1.0) > pivot)
