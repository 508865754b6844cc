"""The collective calls that Python makes by mpi4py, counted; those of PETSc and MUMPS are not among them."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

from mpi4py import MPI

COLLECTIVES = frozenset(
    {"Barrier", "barrier", "Bcast", "bcast", "Allreduce", "allreduce", "Reduce", "reduce", "Allgather", "allgather"}
    | {"Allgatherv", "Gather", "gather", "Gatherv", "Scatter", "scatter", "Scatterv", "Alltoall", "alltoall"}
    | {"Alltoallv", "Reduce_scatter", "Exscan", "exscan", "Scan", "scan"}
)


@contextmanager
def collective_calls() -> Iterator[Counter[str]]:
    """Calls of this rank in the block, by name.  The block gets slower: no time of it is worth anything."""
    calls: Counter[str] = Counter()

    def note(frame: FrameType, event: str, function: Any) -> None:
        if event == "c_call" and function.__name__ in COLLECTIVES and isinstance(function.__self__, MPI.Comm):
            calls[function.__name__] += 1

    sys.setprofile(note)
    try:
        yield calls
    finally:
        sys.setprofile(None)
