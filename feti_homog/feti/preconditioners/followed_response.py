"""The answer of a cell to its unit loads, and columns of its response to jumps, followed while bonds soften.

Both are principal pivot transforms: multipliers on active rows, jumps on the others.  With dC more compliance on the
rows I of bonds that hold, the answer U and the response Gamma become

    U <- U - Gamma_:I B U_I,  Gamma <- Gamma - Gamma_:I B Gamma_I:,  B = (dC^-1 + Gamma_II)^-1.

The rows I need one column each; changes of the other columns that are kept wait until there are many.
"""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from feti_homog.feti.thresholds import FOLLOWED_COLUMNS, WAITING_COLUMNS
from feti_homog.parallel.distributed_arrays import gather_rows
from feti_homog.typing import Float, Int


class FollowedResponse:
    """U and columns of Gamma in the present state.

    Attributes:
        answer: (owned rows, v) U.
    """

    def __init__(self, comm: MPI.Intracomm, first: int, global_rows: int, answer: Float) -> None:
        """`answer` is U; this rank's rows begin at `first`.  No columns yet."""
        self._comm, self._first, self.answer = comm, first, answer
        self._slot = np.full(global_rows, -1)
        self._rows: Int = np.zeros(0, np.int64)
        self._columns = np.zeros((len(answer), 0), order="F")
        # Gamma_:I of the changes that wait, and Gamma_KI B of the rows K that have columns.
        self._waiting = np.zeros((len(answer), WAITING_COLUMNS), order="F")
        self._factors = np.zeros((0, WAITING_COLUMNS))
        self._count = 0

    def lacking(self, rows: Int) -> Int:
        """Return which of the global rows have no column."""
        return rows[self._slot[rows] < 0]

    def add(self, rows: Int, columns: Float) -> None:
        """Take the columns (owned rows, k) of these global rows (k,) in; all others go if they are too many."""
        self._apply_waiting()
        if len(self._rows) + len(rows) > FOLLOWED_COLUMNS:
            self._slot[self._rows] = -1
            self._rows, self._columns = self._rows[:0], self._columns[:, :0]
        self._slot[rows] = len(self._rows) + np.arange(len(rows))
        self._rows = np.concatenate([self._rows, rows])
        self._columns = np.asfortranarray(np.hstack([self._columns, columns]))
        self._factors = np.zeros((len(self._rows), WAITING_COLUMNS))

    def soften(self, rows: Int, more: Float) -> None:
        """Let springs of the global rows (k,), which have columns, gain compliance (k,).  Collective."""
        if self._count + len(rows) > WAITING_COLUMNS:
            self._apply_waiting()
        k, n, at = len(rows), self._count, self._slot[rows]
        columns = self._columns[:, at] - self._waiting[:, :n] @ self._factors[at, :n].T
        everywhere = np.concatenate([rows, self._rows])
        values = gather_rows(self._comm, np.hstack([columns, self.answer]), self._first, everywhere)
        # One rank's rounding is that of all.
        B = self._comm.bcast(np.linalg.inv(np.diag(1.0 / more) + (values[:k, :k] + values[:k, :k].T) / 2))
        self.answer = self.answer - columns @ (B @ values[:k, k:])
        self._waiting[:, n : n + k], self._factors[:, n : n + k] = columns, values[k:, :k] @ B
        self._count += k

    def _apply_waiting(self) -> None:
        n = self._count
        if n:
            self._columns -= self._waiting[:, :n] @ self._factors[:, :n].T
        self._count = 0
