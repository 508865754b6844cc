"""Columns of the response of the reference cell, found when they are first needed, and kept."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from feti_homog.feti.preconditioners.reference_cell import ReferenceCell
from feti_homog.feti.thresholds import INFLUENCE_CHUNK
from feti_homog.parallel.distributed_arrays import gather_rows
from feti_homog.typing import Float, Int


class ResponseColumns:
    """Gamma[:, K] and Gamma[K, K] for a growing set K of rows.

    Attributes:
        rows: (k,) K, global numbers in the order in which they came.
    """

    def __init__(self, comm: MPI.Intracomm, cell: ReferenceCell, owned: tuple[int, int], global_rows: int) -> None:
        """No columns yet; this rank owns the rows from owned[0] up to owned[1]."""
        self._comm, self._cell, self._first = comm, cell, owned[0]
        self.rows: Int = np.zeros(0, np.int64)
        self._position = np.full(global_rows, -1)
        # Both grow in place; a full buffer doubles.
        self._columns = np.zeros((owned[1] - owned[0], INFLUENCE_CHUNK), order="F")
        self._block = np.zeros((INFLUENCE_CHUNK, INFLUENCE_CHUNK))

    @property
    def owned(self) -> Float:
        """(owned rows, k) Gamma[:, K]."""
        return self._columns[:, : len(self.rows)]

    @property
    def block(self) -> Float:
        """(k, k) Gamma[K, K] on every rank."""
        return self._block[: len(self.rows), : len(self.rows)]

    def positions(self, rows: Int) -> Int:
        """Where rows are in K; -1 if they are not."""
        return self._position[rows]

    def clear(self) -> None:
        """Give the memory back; no columns are left."""
        self.rows, self._columns, self._block = self.rows[:0], self._columns[:, :0].copy(), self._block[:0, :0].copy()

    def add(self, rows: Int) -> None:
        """Find the columns of those rows that have none.  Collective."""
        new = np.unique(rows[self._position[rows] < 0])
        for start in range(0, len(new), INFLUENCE_CHUNK):
            some = new[start : start + INFLUENCE_CHUNK]
            unit = np.zeros((len(self._columns), len(some)))
            mine = np.flatnonzero((some >= self._first) & (some < self._first + len(unit)))
            unit[some[mine] - self._first, mine] = 1.0
            self._append(some, self._cell.respond(unit))

    def _append(self, rows: Int, columns: Float) -> None:
        old = len(self.rows)
        self._position[rows] = old + np.arange(len(rows))
        self.rows = np.concatenate([self.rows, rows])
        n = len(self.rows)
        if n > len(self._block):
            more = max(n, 2 * len(self._block)) - len(self._block)
            self._columns = np.asfortranarray(np.pad(self._columns, ((0, 0), (0, more))))
            self._block = np.pad(self._block, (0, more))
        self._columns[:, old:n] = columns
        self._block[:n, old:n] = gather_rows(self._comm, columns, self._first, self.rows)
        self._block[old:n, :old] = self._block[:old, old:n].T
