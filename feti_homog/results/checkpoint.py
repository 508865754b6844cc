"""Checkpoints of a path: small HDF5 files of an event, or of some that are of little weight, whole or not at all.

Rank 0 writes what the ranks' parts add up to; it concerns the interfaces only.  A file has the number of its first
event, and there are no gaps; each carries the run that it belongs to and, ahead of what HDF5 reads, the format and a
checksum.
"""

from __future__ import annotations

import bisect
import contextlib
import re
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from feti_homog.errors import CaseError, FetiHomogError
from feti_homog.parallel.mpi_errors import on_root, on_root_only
from feti_homog.results import atomic, checkpoint_file
from feti_homog.results.checkpoint_file import Arrays

FOLDER, DROPPED = "checkpoint", "checkpoint.dropped"  # the second while it is removed
# Light events that a file has at most; as many a killed run has to find again.
EVENTS_AT_ONCE = 64
EVENT_FILE = re.compile(r"\d{6,}\.h5(\..+\.\d+\.part)?")  # also of a writer that was killed


class Checkpoint:
    """The events of one path in `directory`/checkpoint; every method is collective.

    A context manager: at its end, and where all ranks raise an error of this program, it writes the events that wait.

    Attributes:
        signature: text that an event must carry to belong to this run: case, subdomains and ranks.
    """

    def __init__(self, directory: Path, comm: MPI.Intracomm, signature: str) -> None:
        self.folder, self.comm, self.signature = directory / FOLDER, comm, signature
        # Of rank 0: events that wait, the first events of the files and one after the last, and the file read last.
        self._waiting: list[Arrays] = []
        self._starts = [0]
        self._read: tuple[int, Arrays] = (-1, {})

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
            CaseError: an event is missing, unreadable or of another run.
        """
        try:
            return on_root(self.comm, self._count_checked)
        except CaseError as error:
            raise CaseError(*(f"--resume: {fault}" for fault in error.faults)) from error

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
        self, number: int, whole: Mapping[str, Any], distributed: Mapping[str, NDArray[Any]], light: bool = False
    ) -> None:
        """Add event `number`: numbers that all ranks share, and arrays of which each has a part.

        A `light` event waits for others whose arrays have the same shapes, up to EVENTS_AT_ONCE or one of weight.

        Raises:
            FetiHomogError: the file cannot be written.
        """
        gathered = {name: self.comm.gather(part) for name, part in distributed.items()}
        on_root(self.comm, self._write, number, whole, gathered, light)

    def flush(self) -> None:
        """Write the events that wait.  Raises as `write`."""
        on_root(self.comm, self._flush)

    def keep(self, count: int) -> None:
        """Forget the events from number `count` on.  Raises as `write`."""
        on_root(self.comm, self._keep, count)

    def _clear(self) -> int:
        files = self._files()
        # Whatever another run left there.
        count = sum(map(checkpoint_file.events_in, files))
        remove(self.folder.parent)
        self._waiting, self._starts, self._read = [], [0], (-1, {})
        return count

    def _files(self) -> list[Path]:
        return sorted(self.folder.glob("[0-9]*.h5")) if self.folder.is_dir() else []

    def _file(self, number: int) -> Path:
        return self.folder / f"{number:06d}.h5"

    def _count_checked(self) -> int:
        self._starts = [0]
        for path in self._files():
            if path != self._file(self._starts[-1]):
                raise CaseError(f"event {self._starts[-1]:06d} is missing in {self.folder}")
            events = self._read_file(self._starts[-1])
            self._starts.append(self._starts[-1] + checkpoint_file.length(events))
        return self._starts[-1]

    def _read_event(self, number: int) -> Arrays:
        if number >= self._starts[-1]:
            return self._waiting[number - self._starts[-1]]
        start = self._starts[bisect.bisect_right(self._starts, number) - 1]
        if self._read[0] != start:
            self._read = start, self._read_file(start)
        return {name: table[number - start] for name, table in self._read[1].items()}

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
        self, number: int, whole: Mapping[str, Any], gathered: Mapping[str, list[NDArray[Any]]], light: bool
    ) -> None:
        event = {name: np.asarray(value) for name, value in whole.items()}
        event |= {name: np.concatenate(parts) for name, parts in gathered.items()}
        event |= {f"{name}_ends": np.cumsum([len(p) for p in parts]) for name, parts in gathered.items()}
        if self._waiting and _shapes(event) != _shapes(self._waiting[0]):
            self._flush()
        self._starts[-1] = number - len(self._waiting)
        self._waiting.append(event)
        if not light or len(self._waiting) == EVENTS_AT_ONCE:
            self._flush()

    def _flush(self) -> None:
        if not self._waiting:
            return
        start, events = self._starts[-1], self._waiting
        together = {name: np.stack([event[name] for event in events]) for name in events[0]}

        atomic.replace(self._file(start), lambda part: checkpoint_file.write(part, together, self.signature, start))
        self._starts.append(start + len(events))
        self._waiting = []

    def _keep(self, count: int) -> None:
        start = self._starts[bisect.bisect_right(self._starts, count) - 1]
        kept = [self._read_event(number) for number in range(start, count)]
        with atomic.file_errors("remove", self.folder):
            # The last first: what a killed run leaves has no gaps.
            for path in reversed(self._files()):
                if path > self._file(start) or (path == self._file(start) and not kept):
                    path.unlink()
        self._starts = [*(first for first in self._starts if first < start), start]
        self._waiting, self._read = kept, (-1, {})
        self._flush()


class NoCheckpoint(Checkpoint):
    """Keeps nothing, for runs that leave no files."""

    def __init__(self, comm: MPI.Intracomm) -> None:
        super().__init__(Path(), comm, "")

    def clear(self) -> int:
        return 0

    def count(self) -> int:
        return 0

    def write(
        self, number: int, whole: Mapping[str, Any], distributed: Mapping[str, NDArray[Any]], light: bool = False
    ) -> None:
        """Nothing."""

    def flush(self) -> None:
        """Nothing."""


class EventsInMemory(NoCheckpoint):
    """Keeps the events for fields in memory, for runs that leave no files: what stands on the interfaces, by rank."""

    def __init__(self, comm: MPI.Intracomm) -> None:
        super().__init__(comm)
        self._events: dict[int, Arrays] = {}

    def read(self, number: int) -> Arrays:
        return self._events[number]

    def write(
        self, number: int, whole: Mapping[str, Any], distributed: Mapping[str, NDArray[Any]], light: bool = False
    ) -> None:
        self._events[number] = {name: np.asarray(value) for name, value in {**whole, **distributed}.items()}


def refuse_others(directory: Path) -> None:
    """Check that a run may write its events to `directory`/checkpoint, and remove them.  Call on one rank.

    Raises:
        CaseError: it is no folder, or something else than events stands in it.
        OSError: it cannot be read.
    """
    for folder in (directory / FOLDER, directory / DROPPED):
        if folder.is_symlink() or (folder.exists() and not folder.is_dir()):
            kind = "link" if folder.is_symlink() else "file"
            raise CaseError(
                f"--out {directory}: {folder.name} is a {kind} there, and a run makes a folder of that name"
            )
        others = [path.name for path in folder.iterdir() if not _is_event(path)] if folder.is_dir() else []
        if others:
            raise CaseError(
                f"--out {directory}: no run of this program wrote {folder.name}/{min(others)}, and a run removes "
                f"{folder.name}; move it away or choose another folder"
            )


def remove(directory: Path) -> None:
    """Remove the events in `directory`: under its own name their folder is there as a whole or not at all.

    Call on one rank.

    Raises:
        FetiHomogError: the folder cannot be renamed.
    """
    folder, dropped = directory / FOLDER, directory / DROPPED
    _remove_events(dropped)
    if folder.is_dir():
        with atomic.file_errors("remove", folder):
            atomic.rename(folder, dropped)
        _remove_events(dropped)


def _remove_events(folder: Path) -> None:
    """Remove events as far as it can be: what stays, the next run removes."""
    with contextlib.suppress(OSError):
        for path in folder.iterdir():
            if _is_event(path):
                path.unlink()
        folder.rmdir()


def _is_event(path: Path) -> bool:
    return EVENT_FILE.fullmatch(path.name) is not None and path.is_file()


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
