"""The answer of a cell to its unit loads, and columns of its response, followed while bonds soften, break and close.

U has multipliers on active rows and on the others the jumps that are left; Gamma is the response, multipliers and
jumps, to jumps of active rows and forces on the others.  Both are principal pivot transforms.  With dC more
compliance on the rows I of bonds that hold they become

    U <- U - Gamma_:I B U_I,  Gamma <- Gamma - Gamma_:I B Gamma_I:,  B = (dC^-1 + Gamma_II)^-1,

and where the rows I leave (s = 1) or come to be active (s = -1), with B = Gamma_II^-1,

    U_I <- s B U_I,  Gamma_I: <- s B Gamma_I:,  Gamma_:I <- Gamma_:I B s,  Gamma_II <- -s B s,

all others as above.  Springs of rows that are not active have C_0: Gamma_II gives up their gains where they leave,
and takes these where they come.  The rows I need one column each; changes of the other columns that are kept wait
until there are many.

A row that leaves without a force, for it alone resisted a motion of a body, becomes a pin: it stays among the active
ones, where it bears nothing and its jump, like the place of the body, is as good as any other.  Pins leave when rows
come that resist the motion.
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
        pins: (p,) global rows that left and hold bodies that nothing else does.
        had_pins: whether bodies have been free: then U loses digits with every change of their few faces.
    """

    def __init__(self, comm: MPI.Intracomm, first: int, stiffness: Float, answer: Float, capacity: int) -> None:
        """Begin with the `answer` U and no columns; this rank's rows begin at `first`.

        `stiffness` (all rows,) bounds the diagonal of Gamma on active rows; beyond `capacity`, unused columns go.
        """
        self._comm, self._first, self._stiffness = comm, first, stiffness
        self.answer, self.pins, self.had_pins = answer, np.zeros(0, np.int64), False
        self._slot = np.full(len(stiffness), -1)
        self._rows: Int = np.zeros(0, np.int64)
        # When each column was last used, counted in changes.
        self._used, self._now = np.zeros(capacity, np.int64), 0
        # Memory is taken when columns come.
        self._buffer = np.zeros((len(answer), capacity), order="F")
        # What is taken off at changes that wait, and its factors in the columns of the rows K that are kept.
        self._waiting = np.zeros((len(answer), thresholds.WAITING_COLUMNS), order="F")
        self._factors = np.zeros((capacity, thresholds.WAITING_COLUMNS))
        self._count = 0

    def lacking(self, rows: Int) -> Int:
        """Return the global rows without a column."""
        return rows[self._slot[rows] < 0]

    def make_room(self, more: int, needed: Int, useful: Bool) -> None:
        """Make room for `more` columns: the columns that were unused longest go.

        Columns of the rows `needed` stay; columns of `useful` rows (all rows,) go last.
        """
        capacity = len(self._used)
        if len(self._rows) + more <= capacity:
            return
        # Some more at once, for the others move.
        count = max(min(int(thresholds.FOLLOWED_SHARE * capacity), capacity - more), 0)
        spared, is_useful = np.isin(self._rows, needed), useful[self._rows]
        order = np.lexsort([-self._used[: len(self._rows)], ~is_useful, ~spared])
        stay = np.sort(order[: max(count, int(spared.sum()))])
        rows, n = self._rows[stay], len(stay)
        self._slot[self._rows] = -1
        self._slot[rows] = np.arange(n)
        self._rows, self._used[:n] = rows, self._used[stay]
        for part in np.array_split(np.arange(n), n // thresholds.WAITING_COLUMNS + 1):
            # Columns move to the left, so that none is lost.
            self._buffer[:, part] = self._buffer[:, stay[part]]
        self._factors[:n] = self._factors[stay]
        if n + more > capacity:
            wider = np.zeros((len(self._buffer), 2 * (n + more)), order="F")
            wider[:, :n], self._buffer = self._buffer[:, :n], wider
            new = wider.shape[1] - capacity
            self._used, self._factors = np.pad(self._used, (0, new)), np.pad(self._factors, [(0, new), (0, 0)])

    def columns(self, rows: Int) -> Float:
        """Return the columns (owned rows, k) of global rows (k,), which must have columns."""
        at, n = self._slot[rows], self._count
        return np.asarray(self._buffer[:, at] - self._waiting[:, :n] @ self._factors[at, :n].T)

    def product(self, rows: Int, x: Float) -> Float:
        """Multiply the columns of global rows (c,), which must have columns, with x (c, k)."""
        at, n, columns = self._slot[rows], self._count, len(self._rows)
        waiting = self._waiting[:, :n] @ (self._factors[at, :n].T @ x)
        return product_with_some(self._buffer[:, :columns], at, x) - waiting

    def entries(self, rows: Int, of: Int) -> Float:
        """Return the entries (k, c) at global rows (k,) in the columns of global rows `of` (c,).  Collective."""
        at, n, places = self._slot[of], self._count, rows - self._first
        mine = np.flatnonzero((places >= 0) & (places < len(self._buffer)))
        places, entries = places[mine], np.zeros((len(rows), len(of)))
        entries[mine] = self._buffer[places[:, None], at] - self._waiting[places, :n] @ self._factors[at, :n].T
        return distributed_arrays.allreduce_sum(self._comm, entries)

    def blocks(self, pairs: Int) -> Float:
        """Return the diagonal blocks (m, 2, 2) of Gamma at global row pairs (m, 2).  Collective.

        The rows of a pair must have columns and belong to one rank.
        """
        if len(self.lacking(pairs)):
            raise ValueError("rows without columns have no blocks")
        places, at, n = pairs - self._first, self._slot[pairs], self._count
        self._used[at] = self._now
        mine = ((places >= 0) & (places < len(self._buffer))).all(axis=1)
        places, at = places[mine], at[mine]
        blocks = np.zeros((len(pairs), 2, 2))
        blocks[mine] = self._buffer[places[:, :, None], at[:, None, :]]
        blocks[mine] -= self._waiting[places, :n] @ self._factors[at, :n].transpose(0, 2, 1)
        return distributed_arrays.allreduce_sum(self._comm, blocks)

    def add(self, rows: Int, columns: Float) -> None:
        """Add the columns (owned rows, k) of global rows (k,), for which there must be room."""
        self._apply_waiting()
        old, new = len(self._rows), len(self._rows) + len(rows)
        self._slot[rows] = np.arange(old, new)
        self._rows = np.concatenate([self._rows, rows])
        self._buffer[:, old:new], self._used[old:new] = columns, self._now

    def follow(self, rows: Int, turned: Float, gained: Float, pivot: float = thresholds.LEAST_FOLLOWED) -> bool:
        """Let global rows (k,) leave (`turned` is 1), come (-1) or soften (0); springs gain compliance (k,).

        These rows and the pins must have columns.  Return False if pivots below `pivot` lose too many digits; then the
        response belongs to no state.  Collective.
        """
        is_pin = (rows[:, None] == self.pins).any(axis=1)
        if is_pin.any():
            self.pins = np.setdiff1d(self.pins, rows)
        stays = (turned == 0.0) | is_pin
        softer = np.flatnonzero(stays & (gained != 0.0))
        parts = np.array_split(softer, len(softer) // thresholds.WAITING_COLUMNS + 1)
        if not all(self.soften(rows[some], gained[some], pivot) for some in parts if len(some)):
            return False
        # Rows come before others leave, so that fewer bodies are free meanwhile; half of the room is for pins.
        moves = np.flatnonzero(~stays)
        moves = moves[np.argsort(turned[moves], kind="stable")]
        for some in np.array_split(moves, 2 * len(moves) // thresholds.WAITING_COLUMNS + 1) if len(moves) else []:
            if not self._turn(rows[some], turned[some], gained[some], pivot):
                return False
        return True

    def soften(self, rows: Int, more: Float, pivot: float = 0.0) -> bool:
        """Let springs of global rows (k,) gain compliance (k,), of any sign; False as in `follow`.  Collective."""
        self._make_room(len(rows))
        columns, values = self._present(rows)
        k, root = len(rows), np.sqrt(np.abs(more))
        outer = np.outer(root, root)
        block = np.diag(np.sign(more)) + outer * (values[:k, :k] + values[:k, :k].T) / 2
        # One rank's rounding is that of all.
        B = self._comm.bcast(np.linalg.inv(block) * outer if _has_digits(block, pivot) else None)
        if B is not None:
            self._change(columns, B, values)
        return B is not None

    def _turn(self, rows: Int, sign: Float, gained: Float, pivot: float) -> bool:
        """Let rows leave (sign 1) or come (-1), and pins leave with rows that come; False as in `follow`.

        Collective.
        """
        columns, values = self._present(rows)
        # Pins that unit forces on rows that come press.
        forces = values[len(rows) :, : len(rows)][:, sign < 0.0]
        if len(moved := self.pins[(np.abs(forces[self._slot[self.pins]]) > thresholds.LEAST_FOLLOWED).any(axis=1)]):
            rows, none = np.concatenate([rows, moved]), np.zeros(len(moved))
            sign, gained = np.concatenate([sign, none + 1.0]), np.concatenate([gained, none])
            columns, values = self._present(rows)
        if (k := len(rows)) > thresholds.WAITING_COLUMNS:
            return False
        block = (values[:k, :k] + values[:k, :k].T) / 2 - np.diag(np.where(sign < 0.0, gained, 0.0))
        inverse = self._comm.bcast(_regular(block, sign, self._stiffness[rows], pivot))
        if inverse is None:
            return False
        self.answer = self.answer.copy()
        which, B = inverse
        if len(which):
            self._make_room(len(which))
            s, difference, places = sign[which], np.take(columns, which, axis=1), rows[which] - self._first
            mine = np.flatnonzero((places >= 0) & (places < len(columns)))
            places = places[mine]
            turned = difference @ (B * s)
            turned[places] = -(s[:, None] * B * s + np.diag(np.where(s > 0.0, gained[which], 0.0)))[mine]
            # The rows themselves become s B U_I and s B Gamma_I:, from nothing: of what they were, differences lose
            # digits where a stiffness is far from 1.
            self.answer[places], self._buffer[places], self._waiting[places, : self._count] = 0.0, 0.0, 0.0
            difference[places] = -np.diag(s)[mine]
            some = np.concatenate([which, np.arange(k, len(values))])
            self._change(difference, B, np.hstack([values[some][:, which], values[some, k:]]))
            at = self._slot[rows[which]]
            self._buffer[:, at], self._factors[at] = turned, 0.0
        if len(moved) or len(which) < k or len(self.pins):
            loose = np.setdiff1d(np.arange(k), which)
            self.pins, self.had_pins = np.union1d(np.setdiff1d(self.pins, moved), rows[loose]), True
            places = self.pins - self._first
            self.answer[places[(places >= 0) & (places < len(self.answer))]] = 0.0
            # Springs of pins have C_0, as of all rows that are not active.
            if len(loose := loose[gained[loose] != 0.0]):
                return self.soften(rows[loose], gained[loose], pivot)
        return True

    def _present(self, rows: Int) -> tuple[Float, Float]:
        """Return columns (owned rows, k), and rows (k + all columns, k + v) of them and U on all ranks.  Collective."""
        self._now += 1
        self._used[self._slot[rows]] = self._now
        columns = self.columns(rows)
        everywhere = np.concatenate([rows, self._rows])
        return columns, distributed_arrays.gather_rows(
            self._comm, np.hstack([columns, self.answer]), self._first, everywhere
        )

    def _change(self, difference: Float, B: Float, values: Float) -> None:
        """Subtract `difference` B times the rows I from the answer, and later from all columns."""
        n, k = self._count, len(B)
        self.answer = self.answer - difference @ (B @ values[:k, k:])
        self._waiting[:, n : n + k], self._factors[: len(self._rows), n : n + k] = difference, values[k:, :k] @ B
        self._count += k

    def _make_room(self, k: int) -> None:
        if self._count + k > thresholds.WAITING_COLUMNS:
            self._apply_waiting()

    def _apply_waiting(self) -> None:
        n, k = self._count, len(self._rows)
        if n and k and len(self._buffer):
            # In place: a product by itself would take as much memory as all columns.
            product = -1.0, self._waiting[:, :n], self._factors[:k, :n]
            dgemm(*product, beta=1.0, c=self._buffer[:, :k], trans_b=1, overwrite_c=1)
        self._count = 0


def _regular(block: Float, sign: Float, stiffness: Float, pivot: float) -> tuple[Int, Float] | None:
    """Return the rows that can turn, and the inverse of their part of `block` (k, k); None below `pivot`.

    All rows that come (sign -1) can turn, and rows that leave (1) as long as no body becomes free.
    """
    # Rows that leave and rows that come differ by the square of a stiffness.
    root = np.sqrt(np.maximum(np.where(sign > 0.0, stiffness, 1.0 / stiffness), np.abs(block.diagonal())))
    outer = np.outer(root, root)
    scaled, which = block / outer, np.arange(len(block))
    if not _has_digits(scaled, thresholds.LEAST_FOLLOWED):
        come, leave = np.flatnonzero(sign < 0.0), np.flatnonzero(sign > 0.0)
        if not len(leave) or not _has_digits(scaled[come[:, None], come], pivot):
            return None
        across = scaled[come[:, None], leave]
        rest = scaled[leave[:, None], leave] - across.T @ np.linalg.solve(scaled[come[:, None], come], across)
        factor, order, rank, _ = dpstrf(rest, tol=thresholds.ZERO_TOLERANCE, lower=1)
        # The first pivot is taken whatever it is.
        rank = min(rank, int((factor.diagonal() ** 2 > thresholds.ZERO_TOLERANCE).sum()))
        which = np.concatenate([come, leave[order[:rank] - 1]])
        if not _has_digits(scaled[which[:, None], which], pivot):
            return None
    return which, np.linalg.inv(scaled[which[:, None], which]) / outer[which[:, None], which]


def _has_digits(block: Float, pivot: float) -> bool:
    return bool(np.linalg.svd(block, compute_uv=False).min(initial=1.0) > pivot)
