"""Size and checksum of a large file, by which it is known before HDF5 opens it, which wrong bytes may crash."""

from __future__ import annotations

import os
import zlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from feti_homog.runtime.records import BYTES, described
from feti_homog.errors import CaseError
from feti_homog.results import atomic

BLOCK = 1 << 26  # bytes


@dataclass(frozen=True)
class FileSeal:
    """By what a file is known."""

    bytes: int = described("size", BYTES)
    checksum: str = described("CRC-32, in hexadecimal, of the CRC-32s (32 bits, little-endian) of its blocks of 64 MiB")


def seal(path: Path, block: int = BLOCK) -> FileSeal:
    """The seal of a file.  Call on the rank that completed it: others may still see an earlier file of its name.

    Raises:
        FetiHomogError: it cannot be read.
    """
    size = _size(path)
    return FileSeal(size, _checksum(path, size, block))


def check(path: Path, expected: FileSeal, block: int = BLOCK) -> None:
    """Check that a file is the one of this seal.  Call on one rank.

    Raises:
        CaseError: it is not.
        FetiHomogError: it cannot be read.
    """
    size = _size(path)
    if size != expected.bytes:
        raise CaseError(f"{path}: it is damaged, or of another run: it has {size} bytes, not {expected.bytes}")
    if _checksum(path, size, block) != expected.checksum:
        raise CaseError(f"{path}: it is damaged, or of another run: its checksum is wrong")


def _size(path: Path) -> int:
    with atomic.file_errors("read", path):
        return os.stat(path).st_size


def _checksum(path: Path, size: int, block: int) -> str:
    with atomic.file_errors("read", path), path.open("rb", buffering=0) as stream:
        starts = range(0, size, block)
        checksums = [zlib.crc32(os.pread(stream.fileno(), block, start)) for start in starts]
    return f"{zlib.crc32(np.array(checksums, '<u4').tobytes()):08x}"
