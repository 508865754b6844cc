"""Rows of all ranks, sums of small sparse matrices, and solves that ranks share, on every rank."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from mpi4py import MPI
from scipy.sparse import csr_matrix

from feti_homog.typing import Float, Int


def allgather_rows(comm: MPI.Intracomm, own: Float, counts: Int) -> Float:
    """The rows of all ranks below each other, on every rank.  Collective.

    Args:
        own: (counts[rank],) or (counts[rank], k) rows of this rank.
        counts: (ranks,) number of rows of each rank.

    Returns:
        (sum of counts,) or (sum of counts, k).
    """
    whole = np.empty((int(counts.sum()), *own.shape[1:]))
    comm.Allgatherv(np.ascontiguousarray(own), (whole, counts * int(np.prod(own.shape[1:]))))
    return whole


def allreduce_sparse(comm: MPI.Intracomm, part: csr_matrix) -> csr_matrix:
    """The sum over ranks of small sparse matrices of one shape, on every rank.  Collective."""
    if comm.size == 1:
        return part
    entries = part.tocoo()
    parts = comm.allgather((entries.data, entries.row, entries.col))
    data, rows, columns = (np.concatenate(p) for p in zip(*parts, strict=True))
    return csr_matrix((data, (rows, columns)), shape=part.shape)


def share_columns(comm: MPI.Intracomm, solve: Callable[[Float], Float], B: Float) -> Float:
    """solve(B) for B (n,) or (n, k), the same on every rank: each rank solves for some of the columns.  Collective."""
    columns = B.shape[1] if B.ndim == 2 else 1
    if comm.size == 1 or columns == 1:
        return solve(B)
    ends = np.arange(comm.size + 1) * columns // comm.size
    own = slice(*ends[comm.rank : comm.rank + 2])
    part = solve(B[:, own]).T if own.start < own.stop else np.zeros((0, len(B)))
    return allgather_rows(comm, part, np.diff(ends)).T
