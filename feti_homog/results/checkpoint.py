"""Checkpoints of a path: one small HDF5 file an event, written whole or not at all.

Rank 0 writes what the ranks' parts add up to; it concerns the interfaces only.  The events' files are numbered
without gaps; each carries the run that it belongs to and, ahead of what HDF5 reads, the format and a checksum.
"""

from __future__ import annotations

import contextlib
import hashlib
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from feti_homog.errors import CaseError
from feti_homog.parallel.mpi_errors import on_root, on_root_only
from feti_homog.results import atomic

FOLDER, DROPPED = "checkpoint", "checkpoint.dropped"  # the second while it is removed
FORMAT = 8  # of an event's file: to be raised when what an event holds changes
# HDF5 leaves so many bytes at the beginning of a file to its writer; there stands the header.
USER_BLOCK = 512
HEADER = re.compile(rb"feti-homog checkpoint, format (\d+), sha256 ([0-9a-f]{64})\n")
EVENT_FILE = re.compile(r"\d{6,}\.h5(\..+\.\d+\.part)?")  # also of a writer that was killed
UNMARKED = re.compile(rb"\x89HDF\r\n\x1a\n")  # HDF5's own first bytes, as in format 1

Arrays = dict[str, NDArray[Any]]


class Checkpoint:
    """The events of one path in `directory`/checkpoint; every method is collective.

    Attributes:
        signature: text that an event must carry to belong to this run: case, subdomains and ranks.
    """

    def __init__(self, directory: Path, comm: MPI.Intracomm, signature: str) -> None:
        self.folder, self.comm, self.signature = directory / FOLDER, comm, signature

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

    def write(self, number: int, whole: Mapping[str, Any], distributed: Mapping[str, NDArray[Any]]) -> None:
        """Add event `number`: numbers that all ranks share, and arrays of which each has a part.

        Raises:
            FetiHomogError: the file cannot be written.
        """
        gathered = {name: self.comm.gather(part) for name, part in distributed.items()}
        on_root(self.comm, self._write, number, whole, gathered)

    def _clear(self) -> int:
        count = len(self._files())
        remove(self.folder.parent)
        return count

    def _files(self) -> list[Path]:
        return sorted(self.folder.glob("[0-9]*.h5")) if self.folder.is_dir() else []

    def _file(self, number: int) -> Path:
        return self.folder / f"{number:06d}.h5"

    def _count_checked(self) -> int:
        files = self._files()
        missing = next((n for n, path in enumerate(files) if path != self._file(n)), None)
        if missing is not None:
            raise CaseError(f"event {missing:06d} is missing in {self.folder}")
        for number in range(len(files)):
            self._read_event(number)
        return len(files)

    def _read_event(self, number: int) -> Arrays:
        path = self._file(number)
        try:
            _check_bytes(path)
            with h5py.File(path, "r") as file:
                signature, found = str(file.attrs.get("signature", "")), int(file.attrs.get("number", -1))
                event = {name: table[()] for name, table in file.items()}
        except CaseError:
            raise
        except Exception as error:  # h5py may say anything
            raise CaseError(f"{path} is no readable event of a path: {error}") from error
        if signature != self.signature:
            raise CaseError(f"{path} is of another run: expected {self.signature}; found {signature}")
        if found != number:
            raise CaseError(f"{path} is a copy of event {found:06d}: expected event {number:06d}")
        return event

    def _write(self, number: int, whole: Mapping[str, Any], gathered: Mapping[str, list[NDArray[Any]]]) -> None:
        event = {name: np.asarray(value) for name, value in whole.items()}
        event |= {name: np.concatenate(parts) for name, parts in gathered.items()}
        event |= {f"{name}_ends": np.cumsum([len(p) for p in parts]) for name, parts in gathered.items()}

        def write_event(part: Path) -> None:
            part.parent.mkdir(parents=True, exist_ok=True)
            image = _image(event, {"signature": self.signature, "number": number})
            header = f"feti-homog checkpoint, format {FORMAT}, sha256 {hashlib.sha256(image).hexdigest()}\n"
            part.write_bytes(header.encode().ljust(USER_BLOCK, b"\0") + image)

        atomic.replace(self._file(number), write_event)


class NoCheckpoint(Checkpoint):
    """Keeps nothing, for runs that leave no files."""

    def __init__(self, comm: MPI.Intracomm) -> None:
        super().__init__(Path(), comm, "")

    def clear(self) -> int:
        return 0

    def count(self) -> int:
        return 0

    def write(self, number: int, whole: Mapping[str, Any], distributed: Mapping[str, NDArray[Any]]) -> None:
        """Nothing."""


class EventsInMemory(NoCheckpoint):
    """Keeps the events for fields in memory, for runs that leave no files: what stands on the interfaces, by rank."""

    def __init__(self, comm: MPI.Intracomm) -> None:
        super().__init__(comm)
        self._events: dict[int, Arrays] = {}

    def read(self, number: int) -> Arrays:
        return self._events[number]

    def write(self, number: int, whole: Mapping[str, Any], distributed: Mapping[str, NDArray[Any]]) -> None:
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


def _digest(path: Path) -> str:
    """SHA-256 of what follows the user block."""
    with path.open("rb") as file:
        file.seek(USER_BLOCK)
        return hashlib.file_digest(file, "sha256").hexdigest()


def _image(event: Arrays, attributes: Mapping[str, Any]) -> bytes:
    """Return an HDF5 file in memory: on a full disk HDF5 may crash, and writing bytes does not."""
    with h5py.File("event", "w", driver="core", backing_store=False) as file:
        for name, value in event.items():
            file[name] = value
        file.attrs.update(attributes)
        file.flush()
        return bytes(file.id.get_file_image())


def _check_bytes(path: Path) -> None:
    """Refuse a file of another format or other bytes than were written, before HDF5, which a wrong bit may crash.

    Raises:
        CaseError: what is wrong.
    """
    with path.open("rb") as file:
        start = file.read(USER_BLOCK)
    header = HEADER.match(start)
    version = int(header[1]) if header else int(UNMARKED.match(start) is not None)
    if version not in (0, FORMAT):
        raise CaseError(
            f"{path} has the checkpoints' format {version}, this program reads format {FORMAT}; "
            "go on with the program that wrote it, or start again without --resume"
        )
    if header is None or header[2].decode() != _digest(path):
        raise CaseError(f"{path} is damaged: its checksum is wrong")


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
