"""Sums, gathered, exchanged and scaled rows of arrays that ranks own, and exchanged Python objects of any size.

MPI's own exchange of objects would pickle all parts at once and fail from 2 GiB on; here arrays are sent from where
they are.
"""

from collections.abc import Callable
from typing import TypeVar

import numpy as np
from mpi4py import MPI
from mpi4py.util import pkl5

from feti_homog.system.parallel.dividing import even
from feti_homog.typing import Array, Float, Int

T = TypeVar("T")


def scatter(comm: MPI.Intracomm, parts: list[T]) -> T:
    """Send part r of rank 0's list to rank r and return this rank's; the list is empty afterwards.  Collective."""
    large = pkl5.Intracomm(comm)
    if comm.rank:
        received: T = large.recv(source=0)
        return received
    while len(parts) > 1:
        large.send(parts.pop(), dest=len(parts))
    return parts.pop()


def gather(comm: MPI.Intracomm, part: T) -> list[T]:
    """Return the parts of all ranks, by rank, on rank 0, and none on others.  Collective."""
    large = pkl5.Intracomm(comm)
    if comm.rank:
        large.send(part, dest=0)
        return []
    return [part, *(large.recv(source=r) for r in range(1, comm.size))]


def alltoall(comm: MPI.Intracomm, parts: list[T]) -> list[T]:
    """Send part r to rank r and return the parts that all ranks have for this one, by rank.  Collective."""
    large = pkl5.Intracomm(comm)
    received = list(parts)
    for step in range(1, comm.size):
        to, source = (comm.rank + step) % comm.size, (comm.rank - step) % comm.size
        request = large.isend(parts[to], dest=to)
        received[source] = large.recv(source=source)
        request.wait()
    return received


def allreduce_sum(comm: MPI.Intracomm, part: Float) -> Float:
    """sum_rank part_rank of arrays of one shape, on every rank.  Collective."""
    total = np.empty_like(part)
    comm.Allreduce(part, total)
    return total


def gather_rows(comm: MPI.Intracomm, owned: Float, first: int, rows: Int) -> Float:
    """x[rows] on every rank, for x of which each rank owns the rows `owned` (m,) or (m, k).  Collective.

    Args:
        first: global number of this rank's first row.
        rows: global numbers, equal on all ranks.
    """
    mine = (rows >= first) & (rows < first + len(owned))
    values = np.zeros((len(rows), *owned.shape[1:]))
    values[mine] = owned[rows[mine] - first]
    comm.Allreduce(MPI.IN_PLACE, values)
    return values


def allgather_rows(comm: MPI.Intracomm, part: Array, counts: Int) -> Array:
    """Return the rows of all ranks below each other, on every rank. Collective.

    Args:
        part: (counts[rank],) or (counts[rank], k) rows of this rank.
        counts: (ranks,) row count of each rank.

    Returns:
        (sum of counts,) or (sum of counts, k).
    """
    rows = np.empty((int(counts.sum()), *part.shape[1:]), part.dtype)
    comm.Allgatherv(np.ascontiguousarray(part), (rows, counts * int(np.prod(part.shape[1:]))))
    return rows


def share_columns(comm: MPI.Intracomm, solve: Callable[[Float], Float], B: Float) -> Float:
    """Return solve(B) for B (n,) or (n, k), equal on all ranks, each of which solves for some columns.  Collective."""
    columns = B.shape[1] if B.ndim == 2 else 1
    if comm.size == 1 or columns == 1:
        return solve(B)
    ends = even(columns, comm.size)
    span = slice(*ends[comm.rank : comm.rank + 2])
    part = solve(B[:, span]).T if span.start < span.stop else np.zeros((0, len(B)))
    return allgather_rows(comm, part, np.diff(ends)).T


def exchange(comm: MPI.Intracomm, to: Int, *columns: Array) -> list[Array]:
    """Send row i of each column, (k,) or (k, ...), to rank `to[i]`; return the received rows.

    Rows are ordered by the rank that sent them, and rows of one rank as on that rank.  Collective.
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


def scale_rows(weights: Float, x: Float) -> Float:
    """Return diag(weights) x for weights (m,) and x (m,) or (m, k)."""
    return np.asarray((weights if x.ndim == 1 else weights[:, None]) * x)
