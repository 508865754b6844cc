"""Large fronts, which the ranks of a meeting share: blocks of columns are dealt out, and eliminated one by one.

Triangular solves would be done by one rank after the other.  So the ranks invert L as they find it (Raghavan, Parallel
Process. Lett. 8, 1998), and have columns of X above -H, where

    X = L^-1,  H = A_FE A_EE^-1:  y = X f_E,  f_F - H f_E is left,  and x_E = X^T y - H^T x_F.
"""

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
    """A front of the first ranks of a meeting.

    Attributes:
        sharers: these ranks; null on the others.
        inverse: by the number of the first, some of its columns that this rank has, transposed, from the diagonal on.
    """

    sharers: MPI.Intracomm
    inverse: dict[int, Float]

    def _eliminate(self, f: Float) -> tuple[Float, Float]:
        e = self.eliminated
        if self.sharers == MPI.COMM_NULL:
            return f, f
        told, product = self._tell(f[:e], e), np.zeros((e + self.left, f.shape[1]))
        for first, columns in self.inverse.items():
            product[first:] += columns.T @ told[first : first + len(columns)]
        found = self._sum_on_first(product)
        return found[:e], f[e:] + found[e:]

    def _substitute(self, y: Float, x: Float) -> Float:
        if self.sharers == MPI.COMM_NULL:
            return x
        told = self._tell(np.concatenate([y, x]), self.eliminated + self.left)
        product = np.zeros((self.eliminated, x.shape[1]))
        for first, columns in self.inverse.items():
            product[first : first + len(columns)] = columns @ told[first:]
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
        k: np.asfortranarray(A[first:last, min(starts[k], e) :])
        for k, first, last in zip(numbers, ends[:-1], ends[1:], strict=True)
    }
    sharing = subgroup(comm, range(sharers)) if takes_part else MPI.Intracomm(MPI.COMM_NULL)
    is_definite = not takes_part or _factor(sharing, blocks, starts, e)
    inverse = {int(starts[k]): block for k, block in blocks.items() if starts[k] < e}
    rest = np.vstack([np.zeros((0, f)), *(block for k, block in blocks.items() if starts[k] >= e)])
    front = SharedFront(meeting, layout.places, e, f, is_definite, sharing, inverse)
    return front, layout.remainder(own[own >= e] - e, rest)


def _factor(comm: MPI.Intracomm, blocks: dict[int, Float], starts: Int, e: int) -> bool:
    """Let the first blocks, of e columns, become those of the inverse, and the others what is left.  Collective.

    Blocks are transposed: so rows of a column are contiguous in the order of Fortran, and BLAS copies nothing.  The
    rank that has one eliminates it and tells all of it, and each takes it off its blocks behind it, and off those
    before it that are becoming columns of the inverse.  Whether all is definite, as far as this rank knows.
    """
    is_definite = True
    for number in range(int(np.searchsorted(starts, e))):
        start, stop = starts[number : number + 2]
        panel = np.empty((stop - start, starts[-1] - start), order="F")
        if comm.rank == number % comm.size:
            panel[:] = blocks[number]
            is_definite &= _eliminate(panel)
            blocks[number] = np.eye(len(panel), panel.shape[1], order="F")
        comm.Bcast(panel, number % comm.size)
        L, below = np.asfortranarray(panel[:, : stop - start].T), panel[:, stop - start :]
        for k, block in blocks.items():
            if k > number:
                columns = panel[:, starts[k] - start : starts[k + 1] - start]
                rows = panel[:, min(starts[k], e) - start :]
                dgemm(-1.0, columns, rows, beta=1.0, c=block, trans_a=1, overwrite_c=1)
            else:
                here, after = np.split(block[:, start - starts[k] :], [stop - start], axis=1)
                dtrsm(1.0, L, here, side=1, lower=1, trans_a=1, overwrite_b=1)
                if after.size:
                    dgemm(-1.0, here, below, beta=1.0, c=after, overwrite_c=1)
    return is_definite


def _eliminate(panel: Float) -> bool:
    """Let a block of columns (w, m), transposed, of rows from the diagonal on, become that of L.  Whether it is
    definite."""
    width = len(panel)
    L, is_definite = cholesky(np.array(panel[:, :width], order="F"))
    panel[:, :width] = L.T
    if panel.shape[1] > width:
        dtrsm(1.0, L, panel[:, width:], lower=1, overwrite_b=1)
    return is_definite
