"""Fronts of eliminations on a tree of ranks: those of a run, and made-up ones that are timed."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from mpi4py import MPI

from feti_homog.feti.linalg.distributed_solver import RenewedSolver
from feti_homog.feti.linalg.fronts import Front
from feti_homog.feti.linalg.rank_tree import Meeting
from feti_homog.feti.linalg.remainder import Remainder
from feti_homog.feti.linalg.shared_fronts import meet
from feti_homog.feti.linalg.tree_elimination import TreeElimination
from feti_homog.feti.thresholds import FRONT_BLOCK, front_sharers
from feti_homog.typing import Float

# Solves of the coarse problem that are timed; the fastest counts.
TIMED = 5
# Fronts that are timed on two ranks, one after the other and together: unknowns that are eliminated, and left.
FRONTS = ((60, 200), (200, 600), (500, 1000), (1000, 1600), (2000, 0), (2000, 2000))


def fronts_of(solver: RenewedSolver, comm: MPI.Intracomm) -> list[tuple[int, int, int]]:
    """As `FrontSize`, those of all ranks."""
    own = []
    if isinstance(solver.current, TreeElimination):
        first = (front for front in solver.current.fronts if front.meeting.comm.rank == 0)
        own = [(front.eliminated, front.left, front.meeting.comm.size) for front in first]
    return [size for some in comm.allgather(own) for size in some]


def timed_fronts(comm: MPI.Intracomm, loads: int) -> list[tuple[int, int, int, float, float]]:
    """As `TimedFront`, on two ranks that both have all unknowns, alone and together."""
    found = []
    meeting = Meeting(comm, 1)
    for e, f in FRONTS:
        n = e + f
        matrix = np.full((n, n), 1e-3) + np.eye(n)
        copies, once = np.where(np.arange(n) < e, 2, 3), np.ones(n, np.int64)
        own = Remainder(np.arange(n), copies, once, np.arange(n), matrix)
        left, none = np.ones((n, loads)), np.zeros((0 if comm.rank else f, loads))
        for block in (n, FRONT_BLOCK):
            meet(meeting, own, block)[0].destroy()  # the first is slower
            comm.Barrier()
            start = time.perf_counter()
            front, _ = meet(meeting, own, block)
            seconds = time.perf_counter() - start

            def solve(front: Front = front, left: Float = left, none: Float = none) -> None:
                y, _ = front.forward(left)
                front.backward(y, none)

            times = comm.allreduce(seconds, MPI.MAX), comm.allreduce(fastest(solve), MPI.MAX)
            found.append((e, f, front_sharers(n, comm.size, block), *times))
            front.destroy()
    return found


def fastest(work: Callable[[], object]) -> float:
    """Seconds of the fastest of TIMED calls."""
    return min(seconds_of(work) for _ in range(TIMED))


def seconds_of(work: Callable[[], object]) -> float:
    """That it takes."""
    start = time.perf_counter()
    work()
    return time.perf_counter() - start
