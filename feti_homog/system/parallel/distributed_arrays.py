"""Communicate distributed arrays (sums, gathers, exchanges of rows) and Python objects; divide loads among ranks.

mpi4py's exchange of objects would pickle all parts at once and fail from 2 GiB on; here arrays are sent in place.
"""

import heapq
from collections.abc import Callable
from typing import TypeVar

import numpy as np

from feti_homog.typing import AnyInt, Array, Float, Int, Intracomm

T = TypeVar("T")


def _for_large_objects(comm: Intracomm) -> Intracomm:
    """Wrap the communicator so that it sends Python objects of any size."""
    from mpi4py.util import pkl5  # starts MPI

    return pkl5.Intracomm(comm)


def scatter(comm: Intracomm, parts: list[T]) -> T:
    """Send part r of the list on rank 0 to rank r, and return the received part.  Collective.

    The list on rank 0 is empty afterwards.
    """
    large = _for_large_objects(comm)
    if comm.rank:
        received: T = large.recv(source=0)
        return received
    while len(parts) > 1:
        large.send(parts.pop(), dest=len(parts))
    return parts.pop()


def gather(comm: Intracomm, part: T) -> list[T]:
    """Gather the parts of all ranks on rank 0, by rank; other ranks return [].  Collective."""
    large = _for_large_objects(comm)
    if comm.rank:
        large.send(part, dest=0)
        return []
    return [part, *(large.recv(source=r) for r in range(1, comm.size))]


def alltoall(comm: Intracomm, parts: list[T]) -> list[T]:
    """Send part r to rank r, and return the received parts, by rank of the sender.  Collective."""
    large = _for_large_objects(comm)
    received = list(parts)
    for step in range(1, comm.size):
        to, source = (comm.rank + step) % comm.size, (comm.rank - step) % comm.size
        request = large.isend(parts[to], dest=to)
        received[source] = large.recv(source=source)
        request.wait()
    return received


def allreduce_sum(comm: Intracomm, part: Float) -> Float:
    """Sum arrays `part` of equal shape over ranks, on every rank.  Collective."""
    total = np.empty_like(part)
    comm.Allreduce(part, total)
    return total


def gather_rows(comm: Intracomm, owned: Float, first: int, rows: Int) -> Float:
    """Gather rows (r,) or (r, k) of a distributed array on every rank.  Collective.

    Args:
        owned: (m,) or (m, k) rows of this rank.
        first: global number of the first owned row.
        rows: (r,) global row numbers, equal on all ranks.
    """
    mine = (rows >= first) & (rows < first + len(owned))
    values = np.zeros((len(rows), *owned.shape[1:]))
    values[mine] = owned[rows[mine] - first]
    return allreduce_sum(comm, values)


def allgather_rows(comm: Intracomm, part: Array, counts: Int) -> Array:
    """Concatenate the rows of all ranks, on every rank: (sum(counts),) or (sum(counts), k).  Collective.

    Args:
        part: (counts[rank],) or (counts[rank], k) rows of this rank.
        counts: (ranks,) numbers of rows.
    """
    rows = np.empty((int(counts.sum()), *part.shape[1:]), part.dtype)
    comm.Allgatherv(np.ascontiguousarray(part), (rows, counts * int(np.prod(part.shape[1:]))))
    return rows


def share_columns(comm: Intracomm, solve: Callable[[Float], Float], B: Float) -> Float:
    """Return solve(B) on every rank for B (n,) or (n, k); every rank solves for a share of the columns.  Collective.

    B is equal on all ranks, and `solve` must not communicate.
    """
    columns = B.shape[1] if B.ndim == 2 else 1
    if comm.size == 1 or columns == 1:
        return solve(B)
    ends = even(columns, comm.size)
    span = slice(*ends[comm.rank : comm.rank + 2])
    part = solve(B[:, span]).T if span.start < span.stop else np.zeros((0, len(B)))
    return allgather_rows(comm, part, np.diff(ends)).T


def exchange(comm: Intracomm, to: Int, *columns: Array) -> list[Array]:
    """Send row i of all columns, (k,) or (k, ...), to rank `to[i]`; return the received rows.  Collective.

    Received rows are sorted by sender; rows of one sender keep their order.
    """
    order = np.argsort(to, kind="stable")
    sent_counts = np.bincount(to, minlength=comm.size)
    counts = np.empty_like(sent_counts)
    comm.Alltoall(sent_counts, counts)
    received = []
    for column in columns:
        width = int(np.prod(column.shape[1:], dtype=np.int64))
        rows = np.empty((int(counts.sum()), *column.shape[1:]), column.dtype)
        comm.Alltoallv((np.ascontiguousarray(column[order]), sent_counts * width), (rows, counts * width))
        received.append(rows)
    return received


def scale_rows(weights: Float, x: Float) -> Float:
    """Compute diag(weights) x for weights (m,) and x (m,) or (m, k)."""
    return np.asarray((weights if x.ndim == 1 else weights[:, None]) * x)


def balanced(load: AnyInt, n_ranks: int) -> Int:
    """Return a rank for each of the loads (n,): in descending order, each goes to the rank with the least total."""
    ranks = np.zeros(len(load), np.int64)
    heap = [(0, rank) for rank in range(n_ranks)]
    for k in np.argsort(-load, kind="stable"):
        total, rank = heap[0]
        ranks[k] = rank
        heapq.heapreplace(heap, (total + int(load[k]), rank))
    return ranks


def even(count: int, parts: int) -> Int:
    """Return the bounds (parts + 1,) of ranges that divide 0 .. count - 1; lengths differ by at most 1."""
    return np.arange(parts + 1) * count // parts


def ranges(start: Int, count: Int) -> Int:
    """Concatenate the ranges start[i] .. start[i] + count[i] - 1 for start, count (n,)."""
    ends = np.cumsum(count)
    shift: Int = np.repeat(start - ends + count, count)
    return shift + np.arange(count.sum(), dtype=np.int64)
