"""A file of events of a path: arrays of all of them together, in HDF5 behind a header with format and checksum.

A table of HDF5 takes 0.2 ms, so arrays that packing makes little smaller stand in one, BYTES, one after the other.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from feti_homog.errors import CaseError

FORMAT = 10  # to be raised when what an event holds changes
# HDF5 leaves so many bytes at the beginning of a file to its writer; there stands the header.
USER_BLOCK = 512
HEADER = re.compile(rb"feti-homog checkpoint, format (\d+), sha256 ([0-9a-f]{64})\n")
UNMARKED = re.compile(rb"\x89HDF\r\n\x1a\n")  # HDF5's own first bytes, as in format 1
# Bytes from which on an array is packed: of several events most states repeat, and of one most jumps are zero.
LEAST_PACKED, LEAST_PACKED_OF_ONE = 2**12, 2**15
PACKING = {"compression": "gzip", "compression_opts": 1, "shuffle": True}
# Arrays of an event that an equilibrium with the states of its bonds has again.
FOUND_AGAIN = re.compile(r"(lam|jump|used|alpha)(_axial)?(_ends)?")
BYTES = "bytes"

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
            events = {name: table[()] for name, table in file.items() if name != BYTES}
            return events | _apart(file[BYTES][()], json.loads(file.attrs["layout"])), signature, found
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


def lean(event: Arrays) -> Arrays:
    """Return an event without what an equilibrium has again."""
    return {name: value for name, value in event.items() if not FOUND_AGAIN.fullmatch(name)}


def is_whole(event: Arrays) -> bool:
    """Return whether an event has multipliers."""
    return "lam" in event


def row(events: Arrays, number: int) -> Arrays:
    """Return an event of several that stand together."""
    return {name: table[number] for name, table in events.items()}


def _digest(path: Path) -> str:
    """SHA-256 of what follows the user block."""
    with path.open("rb") as file:
        file.seek(USER_BLOCK)
        return hashlib.file_digest(file, "sha256").hexdigest()


def _pays_to_pack(value: NDArray[Any]) -> bool:
    if len(value) > 1:
        return value.nbytes >= LEAST_PACKED
    return value.nbytes >= LEAST_PACKED_OF_ONE and np.count_nonzero(value) < value.size / 4


def _apart(content: NDArray[np.uint8], layout: list[tuple[str, str, list[int]]]) -> Arrays:
    """Return the arrays of this layout, which stand one after the other."""
    arrays, start = Arrays(), 0
    for name, kind, shape in layout:
        size = int(np.prod(shape)) * np.dtype(kind).itemsize
        arrays[name] = content[start : start + size].copy().view(kind).reshape(shape)
        start += size
    return arrays


def _image(events: Arrays, attributes: Mapping[str, Any]) -> bytes:
    """Return an HDF5 file in memory: on a full disk HDF5 may crash, and writing bytes does not."""
    with h5py.File("event", "w", driver="core", backing_store=False) as file:
        packed = {name: value for name, value in events.items() if _pays_to_pack(value)}
        for name, value in packed.items():
            file.create_dataset(name, data=value, **PACKING)
        others = {name: np.ascontiguousarray(value) for name, value in events.items() if name not in packed}
        layout = [(name, value.dtype.str, value.shape) for name, value in others.items()]
        file.create_dataset(BYTES, data=np.frombuffer(b"".join(map(bytes, others.values())), np.uint8))
        file.attrs.update({**attributes, "layout": json.dumps(layout)})
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
