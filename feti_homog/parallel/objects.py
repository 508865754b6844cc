"""Scatter, gather and all-to-all of Python objects of any size.

MPI's own would pickle all parts at once and fail from 2 GiB on; here arrays are sent from where they are.
"""

from __future__ import annotations

from typing import TypeVar

from mpi4py import MPI
from mpi4py.util import pkl5

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
