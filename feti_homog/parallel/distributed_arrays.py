"""Arrays that every rank has, and arrays whose rows are owned by ranks: sums, gathered rows, scaled rows."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from feti_homog.typing import Float, Int


def allreduce_sum(comm: MPI.Intracomm, part: Float) -> Float:
    """sum_rank part_rank of arrays of one shape, on every rank.  Collective."""
    whole = np.empty_like(part)
    comm.Allreduce(part, whole)
    return whole


def gather_rows(comm: MPI.Intracomm, owned: Float, first: int, rows: Int) -> Float:
    """x[rows] on every rank, for x of which each rank owns the rows `owned` (m,) or (m, k).  Collective.

    Args:
        first: global number of this rank's first row.
        rows: global numbers, the same on every rank.
    """
    mine = (rows >= first) & (rows < first + len(owned))
    values = np.zeros((len(rows), *owned.shape[1:]))
    values[mine] = owned[rows[mine] - first]
    comm.Allreduce(MPI.IN_PLACE, values)
    return values


def scale_rows(weights: Float, x: Float) -> Float:
    """diag(weights) x for weights (m,) and x (m,) or (m, k)."""
    scaled: Float = (weights if x.ndim == 1 else weights[:, None]) * x
    return scaled
