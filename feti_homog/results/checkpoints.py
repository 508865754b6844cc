"""Store the events of a path as checkpoints, in one file or in memory.

An event holds the load, bond states and scalars of a path point.  While there is room, the event also holds multipliers
and jumps; without them, a resumed run computes the equilibrium of the event again.

The file is `checkpoint/events` in the result folder.  A line with the format comes first, then records.  A record is a
prefix (content length, CRC-32 of the content, CRC-32 of both numbers) and its content.  The first record holds the
run's signature, every other record an event packed by zlib: a JSON line with names, types and shapes of its arrays,
then their bytes.  A killed run may leave an incomplete last record, which does not count.
"""

import contextlib
import json
import math
import os
import re
import struct
import zlib
from collections.abc import Iterator, Mapping
from itertools import count
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feti_homog.case import Case
from feti_homog.errors import CaseError
from feti_homog.results import atomic
from feti_homog.system.parallel import mpi_errors
from feti_homog.typing import Intracomm

FOLDER, DROPPED, NAME = "checkpoint", "checkpoint.dropped", "events"  # DROPPED is the folder name during its removal
FORMAT = 12  # raise when the content of an event changes
HEAD = re.compile(rb"feti-homog checkpoint, format (\d+)\n")
PREFIX = struct.Struct("<QII")
# Total size of the events in bytes, beyond which further events have no multipliers.
WHOLE_BYTES = 64 * 2**20
# Arrays that a run computes again with the equilibrium of an event.
FOUND_AGAIN = re.compile(r"(lam|jump|used|alpha)(_axial)?(_ends)?")

Arrays = dict[str, NDArray[Any]]


def room_of(case: Case) -> int | None:
    """Return the total size of events, in bytes, above which further events have no multipliers.

    Returns None, for no limit, if all fields are kept, or with friction, where one load has many equilibria.
    """
    return None if case.has_friction or case.output.states == "all" else WHOLE_BYTES


class EventsInMemory:
    """A store of distributed events in memory, for runs without files.  Every method is collective.

    Attributes:
        comm: communicator of the run.
        room: total size in bytes, beyond which further events have no multipliers; None without a limit.
    """

    def __init__(self, comm: Intracomm, room: int | None = WHOLE_BYTES) -> None:
        self.comm, self.room, self._events, self._bytes = comm, room, list[bytes](), 0

    def clear(self) -> None:
        """Remove all events."""
        self._events, self._bytes = [], 0

    def count(self) -> int:
        """Return the number of stored events.  A `Checkpoint` raises CaseError for a damaged or foreign file."""
        return len(self._events)

    def read(self, number: int) -> Arrays:
        """Return event `number`, with this rank's parts of distributed arrays.  Raises CaseError if it is damaged."""
        return unpacked(self._events[number])

    def write(self, number: int, shared: Mapping[str, Any], distributed: Arrays) -> None:
        """Add event `number`; drop former events from this number on.

        Args:
            shared: values, equal on all ranks.
            distributed: this rank's parts of distributed arrays.

        Raises FetiHomogError if a `Checkpoint` cannot write its file.
        """
        event = {name: np.asarray(value) for name, value in {**shared, **distributed}.items()}
        self._bytes -= sum(map(len, self._events[number:]))
        self._events[number:] = [packed(self._kept(event, self.comm.allreduce(self._bytes)))]
        self._bytes += len(self._events[number])

    def _kept(self, event: Arrays, size: int) -> Arrays:
        """Return an event as stored: without multipliers and jumps if earlier events, `size` bytes, fill the room."""
        has_room = self.room is None or size < self.room
        return event if has_room else {name: v for name, v in event.items() if not FOUND_AGAIN.fullmatch(name)}


class Checkpoint(EventsInMemory):
    """A store of events in the file `directory`/checkpoint/events, which rank 0 reads and writes.

    Attributes:
        path: path of the file.
        signature: a line with case, subdomains and ranks, which must agree to resume; then entries of result.json.
    """

    def __init__(self, directory: Path, comm: Intracomm, signature: str, room: int | None = WHOLE_BYTES) -> None:
        super().__init__(comm, room)
        self.path, self.signature = directory / FOLDER / NAME, signature
        self._ends: list[int] = []  # ends of the records on rank 0; the first record is the signature
        self._due = -math.inf  # when events must last: a power failure loses a second of them

    def clear(self) -> None:
        self._ends = []
        mpi_errors.on_root_only(self.comm, remove, self.path.parents[1])

    def count(self) -> int:
        def counted() -> int:
            self._ends = [end for end, _ in records(self.path)] if self.path.is_file() else []
            if number := max(len(self._ends) - 1, 0):
                _, signature = next(records(self.path))
                written, expected = (text.partition("\n")[0] for text in (signature.decode(), self.signature))
                if written != expected:
                    raise CaseError(f"{self.path} is of another run: expected {expected}; found {written}")
            return number

        try:
            return mpi_errors.on_root(self.comm, counted)
        except CaseError as error:
            raise CaseError(*(f"--resume: {fault}" for fault in error.faults)) from error

    def read(self, number: int) -> Arrays:
        def cut() -> list[Arrays]:
            _, content = next(records(self.path, self._ends[number]))
            event, size, parts = unpacked(content), self.comm.size, dict[str, list[NDArray[Any]]]()
            try:
                for name in [name for name in event if not name.endswith("_ends")]:
                    value, ends = event[name], event.get(f"{name}_ends")
                    parts[name] = [value] * size if ends is None else np.split(value, ends.reshape(size)[:-1])
                return [{name: of_ranks[rank] for name, of_ranks in parts.items()} for rank in range(size)]
            except (IndexError, TypeError, ValueError) as error:
                raise CaseError(f"{self.path} is damaged: its arrays are not of {size} ranks") from error

        part: Arrays = self.comm.scatter(mpi_errors.on_root_only(self.comm, cut) or [])
        return part

    def write(self, number: int, shared: Mapping[str, Any], distributed: Arrays) -> None:
        gathered = {name: self.comm.gather(part) or [] for name, part in distributed.items()}

        def append() -> None:
            event = {name: np.asarray(value) for name, value in shared.items()}
            event |= {name: np.concatenate(parts) for name, parts in gathered.items()}
            event |= {f"{name}_ends": np.cumsum([len(p) for p in parts]) for name, parts in gathered.items()}
            if not self._ends:
                atomic.append(self.path, 0, begin(self.signature), lasts=False)
                self._ends = [len(begin(self.signature))]
            del self._ends[number + 1 :]
            content = record(packed(self._kept(event, self._ends[-1])))
            is_due = monotonic() >= self._due
            atomic.append(self.path, self._ends[-1], content, lasts=is_due)
            self._due = monotonic() + 1.0 if is_due else self._due
            self._ends.append(self._ends[-1] + len(content))

        mpi_errors.on_root(self.comm, append)


def begin(signature: str) -> bytes:
    """Return the first bytes of an event file: the format, and the signature as a record."""
    return b"feti-homog checkpoint, format %d\n" % FORMAT + record(signature.encode())


def record(content: bytes) -> bytes:
    """Return `content` as a record of the event file, with its prefix."""
    numbers = len(content), zlib.crc32(content)
    return PREFIX.pack(*numbers, zlib.crc32(b"%d %d" % numbers)) + content


def records(path: Path, start: int = 0) -> Iterator[tuple[int, bytes]]:
    """Yield the end position and the content of each complete record in an event file.

    The iteration begins with the first record, or after `start`, the end position of a record.  Raises CaseError if the
    file is unreadable or damaged, or has another format.
    """
    try:
        with path.open("rb") as stream:
            place, end = stream.seek(start), os.fstat(stream.fileno()).st_size
            if place == 0:
                line, expected = stream.readline(64), begin("").partition(b"\n")[0] + b"\n"
                if line != expected and expected.startswith(line):  # the first line is unfinished
                    return
                if (match := HEAD.fullmatch(line)) is None:
                    raise CaseError(f"{path} is damaged: it does not begin as an event file")
                if int(match[1]) != FORMAT:
                    formats = f"the checkpoints' format {int(match[1])}, this program reads format {FORMAT}"
                    cure = "go on with the program that wrote it, or start again without --resume"
                    raise CaseError(f"{path} has {formats}; {cure}")
                place = len(line)
            for number in count():
                if len(prefix := stream.read(PREFIX.size)) < PREFIX.size:
                    return
                size, checksum, of_both = PREFIX.unpack(prefix)
                is_sound = of_both == zlib.crc32(b"%d %d" % (size, checksum))
                if is_sound and place + PREFIX.size + size > end:
                    return
                content = stream.read(size) if is_sound else b""
                if not is_sound or zlib.crc32(content) != checksum:
                    events = max(number - 1, 0)
                    raise CaseError(f"{path} is damaged; `truncate -s {place} {path}` keeps {events} events")
                place += PREFIX.size + size
                yield place, content
    except OSError as error:
        raise CaseError(f"{path} is no readable event file: {error.strerror}") from error


def packed(event: Arrays) -> bytes:
    """Serialize and compress an event into the content of a record."""
    layout = [(name, value.dtype.str, value.shape) for name, value in event.items()]
    content = b"\n".join([json.dumps(layout).encode(), b"".join(v.tobytes() for v in event.values())])
    compressor = zlib.compressobj(1, strategy=zlib.Z_RLE)  # digits of multipliers have no repetitions to look for
    return compressor.compress(content) + compressor.flush()


def unpacked(content: bytes) -> Arrays:
    """Restore an event from the content of a record.  Raises CaseError for a damaged or unreasonably large event."""
    try:
        data = zlib.decompressobj().decompress(content, max(8 * WHOLE_BYTES, 16 * len(content)))
        event, start = Arrays(), data.index(b"\n", 0, 1 << 16) + 1
        for name, kind, shape in json.loads(data[:start]):
            event[str(name)] = np.frombuffer(data, kind, math.prod(shape), start).reshape(shape).copy()
            start += event[name].nbytes
    except (ArithmeticError, RecursionError, SyntaxError, TypeError, ValueError, zlib.error) as error:
        raise CaseError(f"an event of the checkpoint is damaged: {error}") from error
    return event


def refuse_others(directory: Path) -> None:
    """Check that the checkpoint folders in `directory` are missing, or contain only events.  Call on one rank.

    Raises CaseError if a file or a link has the name of such a folder, or a folder has files other than events; OSError
    if a folder cannot be read.
    """
    for folder in (directory / FOLDER, directory / DROPPED):
        if folder.is_symlink() or (folder.exists() and not folder.is_dir()):
            kind = "link" if folder.is_symlink() else "file"
            raise CaseError(f"--out {directory}: {folder.name} is a {kind} there, and a run makes that folder")
        paths = list(folder.iterdir()) if folder.is_dir() else []
        if foreign := [path.name for path in paths if path.name != NAME or not path.is_file()]:
            fault = f"no run of this program wrote {folder.name}/{min(foreign)}, and a run removes {folder.name}"
            raise CaseError(f"--out {directory}: {fault}; move it away or choose another folder")


def remove(directory: Path) -> None:
    """Rename the checkpoint, then delete it as far as possible.  On one rank.  FetiHomogError if the renaming fails."""
    folder, dropped = directory / FOLDER, directory / DROPPED
    _remove_events(dropped)
    if folder.is_dir():
        with atomic.file_errors("remove", folder):
            atomic.rename(folder, dropped)
        _remove_events(dropped)


def _remove_events(folder: Path) -> None:
    """Remove the event file and its `folder`.  Errors are ignored: the next run removes the rest."""
    with contextlib.suppress(OSError):
        (folder / NAME).unlink(missing_ok=True)
        folder.rmdir()
