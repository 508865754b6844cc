"""Large fronts, which the ranks of a meeting share: blocks of columns are dealt out, and eliminated one by one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from scipy.linalg.blas import dtrsm

from feti_homog.common.exchange import exchange
from feti_homog.feti.linalg.fronts import Front, cholesky, eliminated_alone
from feti_homog.feti.linalg.rank_tree import Meeting, subgroup
from feti_homog.feti.linalg.remainder import FrontLayout, Remainder, dealt, summed
from feti_homog.typing import Float, Int

# Blocks of columns that a rank has of a front at least, if others have some.
LEAST_BLOCKS = 2


@dataclass(frozen=True)
class SharedFront(Front):
    """A front of which each of the first ranks of a meeting has some columns of half.

    Attributes:
        sharers: these ranks; null on the others.
        own: (c,) the columns of this rank; its `half` is (f, c).
        eliminated: e.
    """

    sharers: MPI.Intracomm
    own: Int
    eliminated: int

    def _half_times(self, y: Float) -> Float:
        if self.sharers == MPI.COMM_NULL:
            return y
        return self._sum_on_first(self.half @ self._tell(y, self.eliminated)[self.own])

    def _transposed_half_times(self, x: Float) -> Float:
        if self.sharers == MPI.COMM_NULL:
            return x
        product = np.zeros((self.eliminated, x.shape[1]))
        product[self.own] = self.half.T @ self._tell(x, self.left)
        return self._sum_on_first(product)

    def _tell(self, x: Float, rows: int) -> Float:
        """x (rows, k) of the first rank on all sharers."""
        told = np.ascontiguousarray(x) if self.sharers.rank == 0 else np.empty((rows, x.shape[1]))
        self.sharers.Bcast(told)
        return told

    def _sum_on_first(self, x: Float) -> Float:
        """The sum of all sharers' x on the first, nothing on the others."""
        total = np.empty_like(x) if self.sharers.rank == 0 else np.empty((0, x.shape[1]))
        self.sharers.Reduce(np.ascontiguousarray(x), total if self.sharers.rank == 0 else None)
        return total

    def destroy(self) -> None:
        """Free the communicator.  Collective in the meeting."""
        if self.sharers != MPI.COMM_NULL:
            self.sharers.Free()


def meet(meeting: Meeting, own: Remainder, block: int) -> tuple[Front, Remainder]:
    """Eliminate what no rank of a third group has, of what the halves of a meeting have left.  Collective in it.

    Ranks share it in blocks of so many columns, where it has so many.  A front that is not definite is NaN, and so is
    what it leaves.
    """
    layout = FrontLayout.of(meeting, own)
    sharers = min(meeting.comm.size, max(1, layout.n // (LEAST_BLOCKS * block)))
    A = summed(meeting, own, layout, block, sharers)
    if sharers == 1:
        return eliminated_alone(meeting, layout, A)
    return _eliminated_together(meeting, layout, A, block, sharers)


def _eliminated_together(
    meeting: Meeting, layout: FrontLayout, A: Float, block: int, sharers: int
) -> tuple[Front, Remainder]:
    """The front of a symmetric matrix whose rows A (r, n) are `dealt` out."""
    comm, e = meeting.comm, layout.eliminated
    sharing = subgroup(comm, range(sharers)) if comm.rank < sharers else MPI.Intracomm(MPI.COMM_NULL)
    own = dealt(layout.n, block, sharers, comm.rank)
    columns, c = A.T, int(np.searchsorted(own, e))
    is_definite = sharing == MPI.COMM_NULL or _factor(sharing, columns, own, e, block)
    L = _gathered_on_first(sharing, own[:c], columns[:e, :c], e)
    half, rest = np.asfortranarray(columns[e:, :c]), np.ascontiguousarray(columns[e:, c:].T)
    front = SharedFront(meeting, layout.places, layout.n - e, L, half, is_definite, sharing, own[:c], e)
    return front, Remainder(*layout[2:], own[c:] - e, rest)


def _factor(comm: MPI.Intracomm, A: Float, own: Int, e: int, block: int) -> bool:
    """Let the columns `own` (c,) of A (n, c), dealt out among ranks, become those of L and half below the diagonal, and
    those behind the first e of what is left.  Whether all is definite, as far as this rank knows.  Collective.

    A panel of columns is eliminated by the rank that has it, which tells all, and taken off by each from its columns.
    """
    is_definite = True
    for start in range(0, e, block):
        stop, owner = min(start + block, e), start // block % comm.size
        panel = np.empty((len(A) - start, stop - start), order="F")
        if comm.rank == owner:
            at = int(np.searchsorted(own, start))
            is_definite &= _eliminate(A[start:, at : at + stop - start], panel)
        comm.Bcast(panel, owner)
        first = int(np.searchsorted(own, stop))
        while first < len(own):
            last = min(first - first % block + block, len(own))
            # Of the columns behind e, all rows are wanted that are left.
            below = min(int(own[first]), e)
            A[below:, first:last] -= panel[below - start :] @ panel[own[first:last] - start].T
            first = last
    return is_definite


def _eliminate(columns: Float, panel: Float) -> bool:
    """Eliminate the panel of these columns (m, w); both become those of L.  Whether the matrix is definite."""
    width = columns.shape[1]
    panel[:width], is_definite = cholesky(np.array(columns[:width], order="F"))
    if len(panel) > width:
        L = np.asfortranarray(panel[:width])
        panel[width:] = dtrsm(1.0, L, np.asfortranarray(columns[width:]), side=1, lower=1, trans_a=1, overwrite_b=1)
    columns[:] = panel
    return is_definite


def _gathered_on_first(comm: MPI.Intracomm, own: Int, columns: Float, e: int) -> Float:
    """(e, e) lower triangle whose columns `own` (c,) this rank has, (e, c), on the first rank; (0, 0) on others."""
    if comm == MPI.COMM_NULL:
        return np.zeros((0, 0))
    which, rows = exchange(comm, np.zeros(len(own), np.int64), own, np.ascontiguousarray(columns.T))
    if comm.rank:
        return np.zeros((0, 0))
    L = np.empty((e, e), order="F")
    L[:, which] = rows.T
    return L
