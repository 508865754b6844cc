"""Coarse problems small enough that every rank holds all of them, and solves for some of the right-hand sides."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI
from scipy.sparse import csr_matrix

from feti_homog.feti.linalg.collectives import allreduce_sparse
from feti_homog.feti.linalg.saddle_point import SaddlePoint
from feti_homog.feti.thresholds import COARSE_ACCURACY, DEFAULTS, Thresholds
from feti_homog.typing import Float


class ReplicatedSaddlePoint:
    """A `SaddlePoint` with all of its matrices on every rank; each rank solves for some of the right-hand sides.

    Attributes:
        local: the saddle point of this rank.
        well_conditioned: whether it is so on every rank.
        entries: nonzero ones in the parts of the matrices of all ranks together.
    """

    def __init__(
        self,
        comm: MPI.Intracomm,
        E: csr_matrix,
        K: csr_matrix,
        null_projector: csr_matrix,
        prefix: str,
        accuracy: float = COARSE_ACCURACY,
    ) -> None:
        """As `SaddlePoint`; what one rank raises is raised on every rank."""
        self.comm = comm
        self.entries: int = comm.allreduce(int(E.nnz + K.nnz))
        whole = allreduce_sparse(comm, E), allreduce_sparse(comm, K)
        error = None
        try:
            self.local = SaddlePoint(MPI.COMM_SELF, *whole, null_projector, prefix, accuracy)
        except np.linalg.LinAlgError as caught:
            error = caught
        # Rounding may differ from rank to rank where their processors do.
        if comm.allreduce(error is not None, MPI.LOR):
            raise error or np.linalg.LinAlgError("a coarse matrix is singular, as another rank found")
        self.well_conditioned: bool = comm.allreduce(self.local.well_conditioned, MPI.LAND)

    def solve(self, f: Float, g: Float) -> tuple[Float, Float]:
        """As `SaddlePoint.solve`: each rank solves for some columns, and all get all.  Collective."""
        n, k = len(f), f.size // len(f)
        ends = np.arange(self.comm.size + 1) * k // self.comm.size
        first, last = ends[self.comm.rank : self.comm.rank + 2]
        whole = np.empty((k, n + len(g)))
        columns = zip(*(x.reshape(len(x), k).T[first:last] for x in (f, g)), strict=True)
        for column, right in enumerate(columns, first):
            whole[column] = np.concatenate(self.local.solve(*right))
        self.comm.Allgatherv(MPI.IN_PLACE, (whole, np.diff(ends) * whole.shape[1]))
        c, a = np.split(whole.T, [n])
        return c.reshape(f.shape), a.reshape(g.shape)

    def destroy(self) -> None:
        """Free the factor."""
        self.local.destroy()


def coarse_saddle_point(
    comm: MPI.Intracomm,
    E: csr_matrix,
    K: csr_matrix,
    null_projector: csr_matrix,
    prefix: str,
    thresholds: Thresholds = DEFAULTS,
) -> SaddlePoint | ReplicatedSaddlePoint:
    """The coarse problem of these parts, replicated or not as the thresholds say.  Collective; see `SaddlePoint`."""
    kind = ReplicatedSaddlePoint if thresholds.replicates(E.shape[0], comm.size) else SaddlePoint
    return kind(comm, E, K, null_projector, prefix)
