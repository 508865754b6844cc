"""Coarse problems small enough that every rank holds all of them, and solves for some of the right-hand sides."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI
from scipy.sparse import csr_matrix

from feti_homog.feti.linalg.distributed_matrix import total
from feti_homog.feti.linalg.saddle_point import SaddlePoint
from feti_homog.feti.thresholds import DEFAULTS
from feti_homog.typing import Float


class Replicated:
    """A `SaddlePoint` with all of its matrices on every rank; the columns of its right-hand sides are dealt out.

    Attributes:
        alone: that of this rank.
        benign: whether it is so on every rank.
        entries: nonzero ones of all ranks' parts of the matrices, which every rank is told.
    """

    def __init__(self, comm: MPI.Intracomm, E: csr_matrix, K: csr_matrix, free: csr_matrix, prefix: str) -> None:
        """As `SaddlePoint`."""
        self.comm = comm
        self.entries: int = comm.allreduce(int(E.nnz + K.nnz))
        whole = total(comm, E), total(comm, K)
        error = None
        try:
            self.alone = SaddlePoint(MPI.COMM_SELF, *whole, free, prefix)
        except np.linalg.LinAlgError as caught:
            error = caught
        # Rounding may differ from rank to rank where their processors do.
        if comm.allreduce(error is not None, MPI.LOR):
            raise error or np.linalg.LinAlgError("a coarse matrix is singular, as another rank found")
        self.benign: bool = comm.allreduce(self.alone.benign, MPI.LAND)

    def solve(self, f: Float, g: Float) -> tuple[Float, Float]:
        """As `SaddlePoint.solve`: each rank tells the others what it has found for its columns.  Collective."""
        n, k = len(f), f.size // len(f)
        ends = np.arange(self.comm.size + 1) * k // self.comm.size
        first, last = ends[self.comm.rank : self.comm.rank + 2]
        whole = np.empty((k, n + len(g)))
        columns = zip(*(x.reshape(len(x), k).T[first:last] for x in (f, g)), strict=True)
        for column, right in enumerate(columns, first):
            whole[column] = np.concatenate(self.alone.solve(*right))
        self.comm.Allgatherv(MPI.IN_PLACE, (whole, np.diff(ends) * whole.shape[1]))
        c, a = np.split(whole.T, [n])
        return c.reshape(f.shape), a.reshape(g.shape)

    def destroy(self) -> None:
        """Free the factor."""
        self.alone.destroy()


def saddle_point(
    comm: MPI.Intracomm,
    E: csr_matrix,
    K: csr_matrix,
    free: csr_matrix,
    prefix: str,
    largest_replicated: int = DEFAULTS.replicated_vectors,
) -> SaddlePoint | Replicated:
    """The coarse problem of these parts, replicated up to so many rows of E.  Collective; see `SaddlePoint`."""
    replicated = comm.size > 1 and E.shape[0] <= largest_replicated
    return (Replicated if replicated else SaddlePoint)(comm, E, K, free, prefix)
