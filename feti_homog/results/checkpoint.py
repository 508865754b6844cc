"""Checkpoints of a path: events appended to one file, or kept in memory.

An event holds load, bond states and scalars.  As long as there is room it also holds multipliers and jumps; afterwards
an equilibrium under its load, with its bonds, finds them again.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from feti_homog.case.case import Case
from feti_homog.errors import CaseError
from feti_homog.results import atomic, checkpoint_file
from feti_homog.results.checkpoint_file import FOLDER, NAME, Arrays, packed, records, unpacked
from feti_homog.system.parallel.mpi_errors import on_root, on_root_only

# Bytes of events up to which they have their multipliers.
WHOLE_BYTES = 64 * 2**20
# Arrays that an equilibrium with the bonds of the event has again.
FOUND_AGAIN = re.compile(r"(lam|jump|used|alpha)(_axial)?(_ends)?")


class NoCheckpoint:
    """Drop all events, for runs that leave no files; every method is collective.

    Attributes:
        room: bytes up to which events have their multipliers; None without a limit.
    """

    def __init__(self, comm: MPI.Intracomm, room: int | None = WHOLE_BYTES) -> None:
        self.comm, self.room = comm, room

    def clear(self) -> int:
        """Forget all events; returns their number."""
        return 0

    def count(self) -> int:
        """Return the number of events, after a check of each.

        Raises:
            CaseError: an event is unreadable or of another run.
        """
        return 0

    def read(self, number: int) -> Arrays:
        """Return an event: this rank's part of distributed arrays, other arrays in full.

        Raises:
            CaseError: it is unreadable.
        """
        raise NotImplementedError

    def write(self, number: int, shared: Mapping[str, Any], distributed: Arrays, light: bool = False) -> None:
        """Add event `number`, in place of all events from this number on.

        Args:
            shared: numbers that are the same on all ranks.
            distributed: arrays, each with this rank's part.
            light: the event is found again at once, and may be lost if the power fails.

        Raises:
            FetiHomogError: the file cannot be written.
        """

    def _kept(self, event: Arrays, size: int) -> Arrays:
        """Return the arrays to keep of an event behind `size` bytes of events."""
        has_room = self.room is None or size < self.room
        return event if has_room else {name: v for name, v in event.items() if not FOUND_AGAIN.fullmatch(name)}


class EventsInMemory(NoCheckpoint):
    """Keep the events in memory, each rank its part, for runs that leave no files."""

    def __init__(self, comm: MPI.Intracomm, room: int | None = WHOLE_BYTES) -> None:
        super().__init__(comm, room)
        self._events: list[bytes] = []
        self._bytes = 0

    def count(self) -> int:
        return len(self._events)

    def read(self, number: int) -> Arrays:
        return unpacked(self._events[number])

    def write(self, number: int, shared: Mapping[str, Any], distributed: Arrays, light: bool = False) -> None:
        event = {name: np.asarray(value) for name, value in {**shared, **distributed}.items()}
        del self._events[number:]
        self._events.append(packed(self._kept(event, self.comm.allreduce(self._bytes))))
        self._bytes += len(self._events[-1])


class Checkpoint(NoCheckpoint):
    """Keep the events in `directory`/checkpoint/events, which rank 0 writes.

    Attributes:
        signature: text of case, subdomains and ranks, by which events belong to this run.
    """

    def __init__(self, directory: Path, comm: MPI.Intracomm, signature: str, room: int | None = WHOLE_BYTES) -> None:
        super().__init__(comm, room)
        self.path, self.signature = directory / FOLDER / NAME, signature
        self._ends: list[int] = []  # of the records, on rank 0; the signature's first

    def clear(self) -> int:
        return on_root(self.comm, self._clear)

    def count(self) -> int:
        try:
            return on_root(self.comm, self._count)
        except CaseError as error:
            raise CaseError(*(f"--resume: {fault}" for fault in error.faults)) from error

    def read(self, number: int) -> Arrays:
        event = on_root_only(self.comm, lambda: unpacked(next(records(self.path, self._ends[number]))[1]))
        part: Arrays = self.comm.scatter([] if event is None else [_part(event, k) for k in range(self.comm.size)])
        return part

    def write(self, number: int, shared: Mapping[str, Any], distributed: Arrays, light: bool = False) -> None:
        gathered = {name: self.comm.gather(part) for name, part in distributed.items()}
        on_root(self.comm, self._write, number, shared, gathered, light)

    def _clear(self) -> int:
        try:
            count = self._count_records()
        except CaseError:  # whatever another run left there
            count = 1
        checkpoint_file.remove(self.path.parents[1])
        self._ends = []
        return count

    def _count_records(self) -> int:
        checkpoint_file.refuse_former(self.path.parent)
        self._ends = [end for end, _ in records(self.path)] if self.path.is_file() else []
        return max(len(self._ends) - 1, 0)

    def _count(self) -> int:
        if count := self._count_records():
            written = next(records(self.path))[1].decode()
            if written != self.signature:
                raise CaseError(f"{self.path} is of another run: expected {self.signature}; found {written}")
        return count

    def _write(
        self, number: int, shared: Mapping[str, Any], gathered: Mapping[str, list[NDArray[Any]]], light: bool
    ) -> None:
        event = {name: np.asarray(value) for name, value in shared.items()}
        event |= {name: np.concatenate(parts) for name, parts in gathered.items()}
        event |= {f"{name}_ends": np.cumsum([len(p) for p in parts]) for name, parts in gathered.items()}
        if not self._ends:
            first = checkpoint_file.begin(self.signature)
            atomic.append(self.path, 0, first, False)
            self._ends = [len(first)]
        del self._ends[number + 1 :]
        content = checkpoint_file.record(packed(self._kept(event, self._ends[-1])))
        atomic.append(self.path, self._ends[-1], content, not light)
        self._ends.append(self._ends[-1] + len(content))


def has_multipliers(event: Arrays) -> bool:
    """Return whether an event has its multipliers."""
    return "lam" in event


def room_of(case: Case) -> int | None:
    """Return the bytes up to which a path keeps multipliers; None with friction, or if all fields are kept.

    With friction many equilibria exist under one load.
    """
    return None if case.has_friction or case.output.states == "all" else WHOLE_BYTES


def _part(event: Arrays, rank: int) -> Arrays:
    """Return an event with the distributed arrays cut to the part of `rank`."""
    part = {}
    for name, table in event.items():
        if name.endswith("_ends"):
            continue
        ends = event.get(f"{name}_ends")
        if ends is not None:
            table = table[ends[rank - 1] if rank else 0 : ends[rank]]
        part[name] = table
    return part
