"""Rows of all ranks, and solves that ranks share, on every rank."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from mpi4py import MPI

from feti_homog.parallel.dividing import even
from feti_homog.typing import Array, Float, Int


def allgather_rows(comm: MPI.Intracomm, own: Array, counts: Int) -> Array:
    """The rows of all ranks below each other, on every rank.  Collective.

    Args:
        own: (counts[rank],) or (counts[rank], k) rows of this rank.
        counts: (ranks,) number of rows of each rank.

    Returns:
        (sum of counts,) or (sum of counts, k).
    """
    whole = np.empty((int(counts.sum()), *own.shape[1:]), own.dtype)
    comm.Allgatherv(np.ascontiguousarray(own), (whole, counts * int(np.prod(own.shape[1:]))))
    return whole


def share_columns(comm: MPI.Intracomm, solve: Callable[[Float], Float], B: Float) -> Float:
    """solve(B) for B (n,) or (n, k), the same on every rank: each rank solves for some of the columns.  Collective."""
    columns = B.shape[1] if B.ndim == 2 else 1
    if comm.size == 1 or columns == 1:
        return solve(B)
    ends = even(columns, comm.size)
    own = slice(*ends[comm.rank : comm.rank + 2])
    part = solve(B[:, own]).T if own.start < own.stop else np.zeros((0, len(B)))
    return allgather_rows(comm, part, np.diff(ends)).T
