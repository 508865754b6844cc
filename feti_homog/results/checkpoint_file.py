"""A file of events of a path: arrays of all of them together, in HDF5 behind a header with format and checksum."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
from numpy.typing import NDArray

from feti_homog.errors import CaseError

FORMAT = 9  # to be raised when what an event holds changes
# HDF5 leaves so many bytes at the beginning of a file to its writer; there stands the header.
USER_BLOCK = 512
HEADER = re.compile(rb"feti-homog checkpoint, format (\d+), sha256 ([0-9a-f]{64})\n")
UNMARKED = re.compile(rb"\x89HDF\r\n\x1a\n")  # HDF5's own first bytes, as in format 1
# Of several events most states repeat, and take little room.
PACKING = {"compression": "gzip", "compression_opts": 1, "shuffle": True}

Arrays = dict[str, NDArray[Any]]


def write(path: Path, events: Arrays, signature: str, number: int) -> None:
    """Write arrays (events, ...) of a run with this signature, of which `number` is the first event."""
    path.parent.mkdir(parents=True, exist_ok=True)
    image = _image(events, {"signature": signature, "number": number})
    header = f"feti-homog checkpoint, format {FORMAT}, sha256 {hashlib.sha256(image).hexdigest()}\n"
    path.write_bytes(header.encode().ljust(USER_BLOCK, b"\0") + image)


def read(path: Path) -> tuple[Arrays, str, int]:
    """Return the arrays of a file, the signature of its run, and the number of its first event.

    Raises:
        CaseError: it is unreadable.
    """
    try:
        _check_bytes(path)
        with h5py.File(path, "r") as file:
            signature, found = str(file.attrs.get("signature", "")), int(file.attrs.get("number", -1))
            return {name: table[()] for name, table in file.items()}, signature, found
    except CaseError:
        raise
    except Exception as error:  # h5py may raise anything
        raise CaseError(f"{path} is no readable event of a path: {error}") from error


def length(events: Arrays) -> int:
    """Return the number of events that have these arrays."""
    return len(next(iter(events.values())))


def events_in(path: Path) -> int:
    """Count the events of a file; 1 if it cannot be read."""
    try:
        return length(read(path)[0])
    except CaseError:
        return 1


def _digest(path: Path) -> str:
    """SHA-256 of what follows the user block."""
    with path.open("rb") as file:
        file.seek(USER_BLOCK)
        return hashlib.file_digest(file, "sha256").hexdigest()


def _image(event: Arrays, attributes: Mapping[str, Any]) -> bytes:
    """Return an HDF5 file in memory: on a full disk HDF5 may crash, and writing bytes does not."""
    with h5py.File("event", "w", driver="core", backing_store=False) as file:
        for name, value in event.items():
            is_packed = value.size > 0 and value.ndim > 1 and len(value) > 1
            file.create_dataset(name, data=value, **(PACKING if is_packed else {}))
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
