"""Rows of arrays sent from all ranks to all."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from feti_homog.typing import Array, Int


def exchange(comm: MPI.Intracomm, to: Int, *columns: Array) -> list[Array]:
    """The rows of the columns, each (k,) or (k, ...), that the ranks have for this one; row i goes to rank `to[i]`.

    They come in the order of the ranks that sent them, and of one rank in that rank's order.  Collective.
    """
    order = np.argsort(to, kind="stable")
    sent = np.bincount(to, minlength=comm.size)
    come = np.empty_like(sent)
    comm.Alltoall(sent, come)
    received = []
    for column in columns:
        width = int(np.prod(column.shape[1:], dtype=np.int64))
        rows = np.empty((int(come.sum()), *column.shape[1:]), column.dtype)
        comm.Alltoallv((np.ascontiguousarray(column[order]), sent * width), (rows, come * width))
        received.append(rows)
    return received
