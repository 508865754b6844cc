"""Rows of all ranks and sums of small sparse matrices, on every rank."""

from __future__ import annotations

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
