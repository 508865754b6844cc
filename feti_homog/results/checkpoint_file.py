"""The event file of a path, `checkpoint/events` in its result folder: one appended record per event.

A record is a prefix, content length and CRC-32 checksums of content and prefix, then the content.  The first content is
the run's signature, every other an event packed by zlib: a JSON line with names, types and shapes of its arrays, then
their bytes.  A killed run may leave a last record shorter than its length, which does not count.
"""

from __future__ import annotations

import contextlib
import json
import re
import struct
import zlib
from collections.abc import Iterator
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feti_homog.errors import CaseError
from feti_homog.results import atomic

FOLDER, DROPPED, NAME = "checkpoint", "checkpoint.dropped", "events"  # the second folder while it is removed
FORMAT = 11  # to be raised when the content of an event changes
HEAD = re.compile(rb"feti-homog checkpoint, format (\d+)\n")
# Also files that formats up to 10 had, one an event, and unfinished ones among them.
EVENT_FILE = re.compile(rf"{NAME}|\d{{6,}}\.h5(\..+\.\d+\.part)?")
PREFIX = struct.Struct("<QII")

Arrays = dict[str, NDArray[Any]]


def begin(signature: str) -> bytes:
    """Return the first bytes of an event file: its format, and the record of the signature."""
    return b"feti-homog checkpoint, format %d\n" % FORMAT + record(signature.encode())


def record(content: bytes) -> bytes:
    """Return a content behind its prefix."""
    numbers = len(content), zlib.crc32(content)
    return PREFIX.pack(*numbers, zlib.crc32(b"%d %d" % numbers)) + content


def records(path: Path, start: int = 0) -> Iterator[tuple[int, bytes]]:
    """Yield end and content of each record, from the file's beginning or from the end `start` of a record.

    Raises:
        CaseError: the file has another format or is damaged.
    """
    try:
        with path.open("rb") as stream:
            place = stream.seek(start) or len(_head(stream.readline(), path))
            for number in count():
                prefix = stream.read(PREFIX.size)
                if place == 0 or len(prefix) < PREFIX.size:
                    return
                size, checksum, of_both = PREFIX.unpack(prefix)
                is_sound = of_both == zlib.crc32(b"%d %d" % (size, checksum))
                content = stream.read(size) if is_sound else b""
                if is_sound and len(content) < size:
                    return
                if not is_sound or zlib.crc32(content) != checksum:
                    raise CaseError(f"{path} is damaged: the checksum of record {number} is wrong")
                place += PREFIX.size + size
                yield place, content
    except OSError as error:
        raise CaseError(f"{path} is no readable event file: {error.strerror}") from error


def _head(line: bytes, path: Path) -> bytes:
    """Check the first line of an event file; empty if its run was killed while writing it."""
    expected = begin("").partition(b"\n")[0] + b"\n"
    if line != expected and expected.startswith(line):
        return b""
    if (match := HEAD.fullmatch(line)) is None:
        raise CaseError(f"{path} is damaged: it does not begin as an event file")
    if int(match[1]) != FORMAT:
        raise _other_format(path, int(match[1]))
    return line


def refuse_former(folder: Path) -> None:
    """Refuse a folder with event files of an earlier format.  Raises CaseError."""
    if former := sorted(path.name for path in folder.glob("[0-9]*.h5")):
        raise _other_format(folder / former[0], "10 or less")


def _other_format(path: Path, number: int | str) -> CaseError:
    return CaseError(
        f"{path} has the checkpoints' format {number}, this program reads format {FORMAT}; "
        "go on with the program that wrote it, or start again without --resume"
    )


def packed(event: Arrays) -> bytes:
    """Return an event as the content of a record."""
    layout = [(name, value.dtype.str, value.shape) for name, value in event.items()]
    return zlib.compress(b"\n".join([json.dumps(layout).encode(), b"".join(v.tobytes() for v in event.values())]), 1)


def unpacked(content: bytes) -> Arrays:
    """Return the event of a record."""
    layout, _, data = zlib.decompress(content).partition(b"\n")
    event, start = Arrays(), 0
    for name, kind, shape in json.loads(layout):
        event[name] = np.frombuffer(data, kind, int(np.prod(shape)), start).reshape(shape).copy()
        start += event[name].nbytes
    return event


def refuse_others(directory: Path) -> None:
    """Check that a run may write its events to `directory`/checkpoint, and remove them.  Call on one rank.

    Raises:
        CaseError: it is no folder, or has other files than events.
        OSError: it cannot be read.
    """
    for folder in (directory / FOLDER, directory / DROPPED):
        if folder.is_symlink() or (folder.exists() and not folder.is_dir()):
            kind = "link" if folder.is_symlink() else "file"
            raise CaseError(
                f"--out {directory}: {folder.name} is a {kind} there, and a run makes a folder of that name"
            )
        foreign = [path.name for path in folder.iterdir() if not _is_event(path)] if folder.is_dir() else []
        if foreign:
            raise CaseError(
                f"--out {directory}: no run of this program wrote {folder.name}/{min(foreign)}, and a run removes "
                f"{folder.name}; move it away or choose another folder"
            )


def remove(directory: Path) -> None:
    """Remove the events in `directory`; their folder exists complete or not at all.  Call on one rank.

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
    """Remove the events of a folder as far as possible: the next run removes the rest."""
    with contextlib.suppress(OSError):
        for path in folder.iterdir():
            if _is_event(path):
                path.unlink()
        folder.rmdir()


def _is_event(path: Path) -> bool:
    return EVENT_FILE.fullmatch(path.name) is not None and path.is_file()
