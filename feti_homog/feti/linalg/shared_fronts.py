"""Large fronts, which the ranks of a meeting share: blocks of columns are dealt out, and eliminated one by one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from scipy.linalg.blas import dgemm, dtrsm

from feti_homog.feti.linalg.fronts import Front, cholesky, eliminated_alone
from feti_homog.feti.linalg.rank_tree import Meeting, subgroup
from feti_homog.feti.linalg.remainder import FrontLayout, Remainder, summed
from feti_homog.feti.thresholds import front_sharers
from feti_homog.typing import Float, Int


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
    sharers = front_sharers(layout.n, meeting.comm.size, block)
    starts = _starts(layout, block)
    owner = np.repeat(np.arange(len(starts) - 1) % sharers, np.diff(starts))
    A = summed(meeting, own, layout, owner)
    if sharers == 1:
        return eliminated_alone(meeting, layout, A)
    return _eliminated_together(meeting, layout, A, starts, sharers)


def _starts(layout: FrontLayout, block: int) -> Int:
    """(blocks + 1,) where blocks of columns begin, and the last ends; none has both eliminated and other ones."""
    e, n = layout.eliminated, layout.n
    return np.concatenate([np.arange(0, e, block), np.arange(e, n, block), [n]])


def _eliminated_together(
    meeting: Meeting, layout: FrontLayout, A: Float, starts: Int, sharers: int
) -> tuple[Front, Remainder]:
    """The front of a symmetric matrix of whose rows each of the first ranks has those of its blocks, A (r, n)."""
    comm, e, f = meeting.comm, layout.eliminated, len(layout.unknowns)
    takes_part = comm.rank < sharers
    numbers = range(comm.rank, len(starts) - 1, sharers) if takes_part else range(0)
    ends = np.cumsum([0, *(starts[k + 1] - starts[k] for k in numbers)])
    own = np.concatenate([np.zeros(0, np.int64), *(np.arange(*starts[k : k + 2]) for k in numbers)])
    # Of eliminated columns the rows from the diagonal on, of the others those that are left.
    blocks = {
        k: np.asfortranarray(A[first:last, min(starts[k], e) :].T)
        for k, first, last in zip(numbers, ends[:-1], ends[1:], strict=True)
    }
    sharing = subgroup(comm, range(sharers)) if takes_part else MPI.Intracomm(MPI.COMM_NULL)
    is_definite = not takes_part or _factor(sharing, blocks, starts, e)
    eliminated = {int(starts[k]): block for k, block in blocks.items() if starts[k] < e}
    half = np.hstack([np.zeros((f, 0)), *(block[len(block) - f :] for block in eliminated.values())])
    rest = np.vstack([np.zeros((0, f)), *(block.T for k, block in blocks.items() if starts[k] >= e)])
    L, half = _gathered_on_first(sharing, eliminated, e), np.asfortranarray(half)
    front = SharedFront(meeting, layout.places, f, L, half, is_definite, sharing, own[own < e], e)
    return front, layout.remainder(own[own >= e] - e, rest)


def _factor(comm: MPI.Intracomm, blocks: dict[int, Float], starts: Int, e: int) -> bool:
    """Let the first blocks, of e columns, become those of L and half, and the others what is left.  Collective.

    The rank that has a block eliminates it and tells it to all, and each takes it off its blocks behind it.  Whether
    all is definite, as far as this rank knows.
    """
    is_definite = True
    for number in range(int(np.searchsorted(starts, e))):
        start, stop = starts[number : number + 2]
        # Transposed: so rows of it are contiguous in the order of Fortran, and BLAS copies nothing.
        panel = np.empty((stop - start, starts[-1] - start), order="F")
        if comm.rank == number % comm.size:
            is_definite &= _eliminate(blocks[number])
            panel[:] = blocks[number].T
        comm.Bcast(panel, number % comm.size)
        for k in blocks:
            if k > number:
                rows, columns = (
                    panel[:, min(starts[k], e) - start :],
                    panel[:, starts[k] - start : starts[k + 1] - start],
                )
                blocks[k] = dgemm(-1.0, rows, columns, beta=1.0, c=blocks[k], trans_a=1, overwrite_c=1)
    return is_definite


def _eliminate(block: Float) -> bool:
    """Let a block of columns (m, w), of rows from the diagonal on, become that of L.  Whether it is definite."""
    width = block.shape[1]
    block[:width], is_definite = cholesky(np.array(block[:width], order="F"))
    if len(block) > width:
        L, below = np.asfortranarray(block[:width]), np.array(block[width:], order="F")
        block[width:] = dtrsm(1.0, L, below, side=1, lower=1, trans_a=1, overwrite_b=1)
    return is_definite


def _gathered_on_first(comm: MPI.Intracomm, blocks: dict[int, Float], e: int) -> Float:
    """(e, e) L of blocks of columns, by where each begins, on the first rank; (0, 0) on the others.  Collective."""
    if comm == MPI.COMM_NULL:
        return np.zeros((0, 0))
    every = comm.gather({start: block[: e - start] for start, block in blocks.items()})
    if every is None:
        return np.zeros((0, 0))
    L = np.zeros((e, e), order="F")
    for some in every:
        for start, block in some.items():
            L[start:, start : start + block.shape[1]] = block
    return L
