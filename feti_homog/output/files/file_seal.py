"""Size and checksum of a large file, by which it is known before HDF5 opens it, which wrong bytes may crash."""

from __future__ import annotations

import os
import zlib
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from feti_homog.common.mpi_errors import agree, on_root
from feti_homog.common.records import BYTES, described
from feti_homog.errors import CaseError
from feti_homog.output.files import atomic

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

BLOCK = 1 << 26  # bytes


@dataclass(frozen=True)
class FileSeal:
    """By what a file is known."""

    bytes: int = described("size", BYTES)
    checksum: str = described("CRC-32, in hexadecimal, of the CRC-32s (32 bits, little-endian) of its blocks of 64 MiB")


def seal(path: Path, comm: Comm, block: int = BLOCK) -> FileSeal:
    """The seal of a file that all ranks can read, each reading its share of the blocks.  Collective.

    Raises:
        FetiHomogError: it cannot be read.
    """
    size = on_root(comm, _size, path)
    blocks = np.zeros(-(-size // block), "<u4")
    blocks[comm.rank :: comm.size] = agree(comm, _checksums, path, range(comm.rank, len(blocks), comm.size), block)
    return FileSeal(size, _combined(np.bitwise_or.reduce(comm.allgather(blocks))))


def check(path: Path, expected: FileSeal, block: int = BLOCK) -> None:
    """Check that a file is the one of this seal.  Call on one rank.

    Raises:
        CaseError: it is not.
        FetiHomogError: it cannot be read.
    """
    size = _size(path)
    if size != expected.bytes:
        raise CaseError(f"{path}: it is damaged, or of another run: it has {size} bytes, not {expected.bytes}")
    if _combined(np.array(_checksums(path, range(-(-size // block)), block), "<u4")) != expected.checksum:
        raise CaseError(f"{path}: it is damaged, or of another run: its checksum is wrong")


def _size(path: Path) -> int:
    with atomic.file_errors("read", path):
        return os.stat(path).st_size


def _checksums(path: Path, blocks: Iterable[int], size: int) -> list[int]:
    """The CRC-32 of each of these blocks of `size` bytes."""
    with atomic.file_errors("read", path), path.open("rb", buffering=0) as stream:
        return [zlib.crc32(os.pread(stream.fileno(), size, number * size)) for number in blocks]


def _combined(checksums: NDArray[np.uint32]) -> str:
    return f"{zlib.crc32(checksums.tobytes()):08x}"
