"""Checkpoints of a path: HDF5 files of an event, or of some of little weight, each there in full or not at all.

Rank 0 writes what the ranks' parts add up to; it concerns the interfaces only.  A file has the number of its first
event, and there are no gaps; each carries the run that it belongs to and, ahead of what HDF5 reads, the format and a
checksum.

The last events are whole, for a path goes on from one.  From older ones is left out what a solve finds again, once the
files of whole events take WHOLE_BYTES: a file of such lean events replaces those that it has them from.
"""

from __future__ import annotations

import bisect
import contextlib
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from feti_homog.case.case import Case
from feti_homog.errors import CaseError, CheckpointError, FetiHomogError
from feti_homog.results import atomic, checkpoint_file
from feti_homog.results.checkpoint_file import Arrays
from feti_homog.results.checkpoint_folder import FOLDER, remove
from feti_homog.system.parallel.mpi_errors import on_root, on_root_only

# Light events that a file has at most; as many a killed run has to find again.
EVENTS_AT_ONCE = 64
# Bytes that whole events may take.
WHOLE_BYTES = 64 * 2**20


class Checkpoint:
    """The events of one path in `directory`/checkpoint; every method is collective.

    A context manager: at its end, and where all ranks raise an error of this program, it writes the events that wait.

    Attributes:
        signature: text that an event must carry to belong to this run: case, subdomains and ranks.
        room: bytes that whole events may take; None if none may become lean.
    """

    def __init__(self, directory: Path, comm: MPI.Intracomm, signature: str, room: int | None = WHOLE_BYTES) -> None:
        self.folder, self.comm, self.signature, self.room = directory / FOLDER, comm, signature, room
        # Of rank 0: events that wait, the first events of the files and one after the last, and the file read last.
        self._waiting: list[Arrays] = []
        self._starts = [0]
        self._read: tuple[int, Arrays] = (-1, {})
        # The events of whole files, lean, and the bytes of these files; the last event that is settled.
        self._lean: list[Arrays] = []
        self._bytes, self._settled = 0, -1

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            self.flush()
        elif issubclass(kind, FetiHomogError):
            # Report what ended the run, not a disk that is full besides.
            with contextlib.suppress(FetiHomogError):
                self.flush()

    def clear(self) -> int:
        """Forget all events; returns how many there were."""
        return on_root(self.comm, self._clear)

    def count(self) -> int:
        """Return how many events there are, each of which is checked.

        Raises:
            CheckpointError: an event is missing, unreadable or of another run.
        """
        try:
            return on_root(self.comm, self._count_checked)
        except CaseError as error:
            raise CheckpointError(*(f"--resume: {fault}" for fault in error.faults)) from error

    def read(self, number: int) -> Arrays:
        """Return an event: this rank's part of distributed arrays, all of the others.

        Raises:
            CaseError: it is unreadable or of another run.
        """
        event = on_root_only(self.comm, self._read_event, number)
        parts = [] if event is None else [_part(event, rank) for rank in range(self.comm.size)]
        own: Arrays = self.comm.scatter(parts)
        return own

    def write(
        self,
        number: int,
        whole: Mapping[str, Any],
        distributed: Mapping[str, NDArray[Any]],
        light: bool = False,
        settled: int = -1,
    ) -> None:
        """Add event `number`: numbers that all ranks share, and arrays of which each has a part.

        A `light` event waits for others whose arrays have the same shapes, up to EVENTS_AT_ONCE or one of weight.
        Nothing is gone back to before event `settled`: earlier ones may become lean.

        Raises:
            FetiHomogError: the file cannot be written.
        """
        gathered = {name: self.comm.gather(part) for name, part in distributed.items()}
        on_root(self.comm, self._write, number, whole, gathered, light, settled)

    def flush(self) -> None:
        """Write the events that wait.  Raises as `write`."""
        on_root(self.comm, self._flush)

    def keep(self, count: int) -> None:
        """Forget the events from number `count` on.  Raises as `write`."""
        on_root(self.comm, self._keep, count)

    def _clear(self) -> int:
        count = end = 0
        # Whatever another run left there.
        for start in self._starts_of_files():
            if start >= end:
                events = checkpoint_file.events_in(self._file(start))
                count, end = count + events, start + events
        remove(self.folder.parent)
        self._begin_anew()
        return count

    def _begin_anew(self) -> None:
        self._waiting, self._starts, self._read = [], [0], (-1, {})
        self._lean, self._bytes, self._settled = [], 0, -1

    def _starts_of_files(self) -> list[int]:
        """Numbers of the first events of the files, ascending."""
        found = self.folder.glob("[0-9]*.h5") if self.folder.is_dir() else ()
        return sorted(int(path.stem) for path in found if path.stem.isdecimal())

    def _file(self, number: int) -> Path:
        return self.folder / f"{number:06d}.h5"

    def _count_checked(self) -> int:
        self._begin_anew()
        for start in self._starts_of_files():
            end = self._starts[-1]
            if start < end:  # a run was killed when it had replaced it
                continue
            if start != end:
                raise CaseError(f"event {end:06d} is missing in {self.folder}")
            events = self._read_file(end)
            self._add(end, [checkpoint_file.row(events, number) for number in range(checkpoint_file.length(events))])
        return self._starts[-1]

    def _add(self, start: int, events: list[Arrays]) -> None:
        """Take note of the file of these events."""
        self._starts.append(start + len(events))
        if self.room is not None and checkpoint_file.is_whole(events[0]):
            self._lean += map(checkpoint_file.lean, events)
            self._bytes += self._file(start).stat().st_size

    def _read_event(self, number: int) -> Arrays:
        if number >= self._starts[-1]:
            return self._waiting[number - self._starts[-1]]
        start = self._starts[bisect.bisect_right(self._starts, number) - 1]
        if self._read[0] != start:
            self._read = start, self._read_file(start)
        return checkpoint_file.row(self._read[1], number - start)

    def _read_file(self, start: int) -> Arrays:
        """(events, ...) arrays of the file whose first event is `start`."""
        path = self._file(start)
        events, signature, found = checkpoint_file.read(path)
        if signature != self.signature:
            raise CaseError(f"{path} is of another run: expected {self.signature}; found {signature}")
        if found != start:
            raise CaseError(f"{path} is a copy of event {found:06d}: expected event {start:06d}")
        return events

    def _write(
        self,
        number: int,
        whole: Mapping[str, Any],
        gathered: Mapping[str, list[NDArray[Any]]],
        light: bool,
        settled: int,
    ) -> None:
        event = {name: np.asarray(value) for name, value in whole.items()}
        event |= {name: np.concatenate(parts) for name, parts in gathered.items()}
        event |= {f"{name}_ends": np.cumsum([len(p) for p in parts]) for name, parts in gathered.items()}
        if self._waiting and _shapes(event) != _shapes(self._waiting[0]):
            self._flush()
        self._starts[-1] = number - len(self._waiting)
        self._waiting.append(event)
        self._settled = max(self._settled, settled)
        if not light or len(self._waiting) == EVENTS_AT_ONCE:
            self._flush()

    def _flush(self) -> None:
        if not self._waiting:
            return
        start, events = self._starts[-1], self._waiting
        self._write_file(start, events)
        self._add(start, events)
        self._waiting = []
        if self.room is not None and self._bytes > self.room:
            self._make_lean()

    def _write_file(self, start: int, events: list[Arrays]) -> None:
        together = {name: np.stack([event[name] for event in events]) for name in events[0]}
        atomic.replace(self._file(start), lambda part: checkpoint_file.write(part, together, self.signature, start))

    def _make_lean(self) -> None:
        """Replace the whole files before that of the last settled event by one of lean events."""
        first = self._starts[-1] - len(self._lean)
        starts = [start for start in self._starts if first <= start <= self._settled]
        if len(starts) < 2:
            return
        count = starts[-1] - first
        self._write_file(first, self._lean[:count])
        with atomic.file_errors("remove", self.folder):
            for start in starts[1:-1]:
                self._file(start).unlink()
        self._starts = [start for start in self._starts if start not in starts[1:-1]]
        self._lean, self._read = self._lean[count:], (-1, {})
        self._bytes = sum(self._file(start).stat().st_size for start in self._starts[:-1] if start >= starts[-1])

    def _keep(self, count: int) -> None:
        start = self._starts[bisect.bisect_right(self._starts, count) - 1]
        kept = [self._read_event(number) for number in range(start, count)]
        with atomic.file_errors("remove", self.folder):
            # The last first: what a killed run leaves has no gaps.
            for own in reversed(self._starts_of_files()):
                if own > start or (own == start and not kept):
                    self._file(own).unlink()
        if kept:
            self._write_file(start, kept)
        self._count_checked()


def room_of(case: Case) -> int | None:
    """Return the bytes that whole events of a path may take; None if all fields are wanted, or states have a past.

    With friction many states are in equilibrium under one load.
    """
    return None if case.has_friction or case.output.states == "all" else WHOLE_BYTES


def _shapes(event: Arrays) -> dict[str, tuple[int, ...]]:
    return {name: value.shape for name, value in event.items()}


def _part(event: Arrays, rank: int) -> Arrays:
    """Return the event with a rank's share of the distributed arrays."""
    part = {}
    for name, table in event.items():
        if name.endswith("_ends"):
            continue
        ends = event.get(f"{name}_ends")
        if ends is not None:
            table = table[ends[rank - 1] if rank else 0 : ends[rank]]
        part[name] = table
    return part
