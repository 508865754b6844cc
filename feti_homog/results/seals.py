"""Checksums by which damaged or edited files of a result are noticed: in a JSON document, and beside a large file.

HDF5 may crash on wrong bytes, so a large file is checked before it is opened.
"""

from __future__ import annotations

import json
import os
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from feti_homog.errors import CaseError
from feti_homog.results import atomic
from feti_homog.system.runtime.records import BYTES, described

KEY = "checksum"
BLOCK = 1 << 26  # bytes


def dumps(document: Mapping[str, Any]) -> str:
    """Return the text of a document with its checksum as last key.  Raises ValueError for NaN."""
    text = _text({key: value for key, value in document.items() if key != KEY})
    return _sealed(text, _checksum(text))


def loads(text: str) -> dict[str, Any]:
    """Return the document of a text, without its checksum; a text without one is read unchecked.

    Raises:
        ValueError: it is not JSON, no table, or changed since it was written.
    """
    try:
        document = json.loads(text)
    except RecursionError as error:
        raise ValueError("it is nested too deeply") from error
    if not isinstance(document, dict):
        raise ValueError("it is damaged: no table of keys and values")
    if KEY not in document:
        *rest, (_, last) = document.items() if document else [("", None)]
        if isinstance(last, str) and len(last) == 8 and last == _checksum(_text(dict(rest))):
            raise ValueError("it is damaged: the key of its checksum has another name")
        return document
    stored = document.pop(KEY)
    end = _sealed("{\n}", stored)[1:]
    if text.endswith(end) and _checksum(text[: -len(end)] + "\n}") == stored:  # as it was written
        return document
    if stored != _checksum(_text(document)):
        raise ValueError("it is damaged: its checksum is wrong")
    return document


@dataclass(frozen=True)
class FileSeal:
    """Size and checksum of a file."""

    bytes: int = described("size", BYTES)
    checksum: str = described("CRC-32, in hexadecimal, of the CRC-32s (32 bits, little-endian) of its blocks of 64 MiB")


def seal(path: Path, block: int = BLOCK) -> FileSeal:
    """Seal a file.  Call on the rank that completed it: others may still see an earlier file of its name.

    Raises:
        FetiHomogError: it cannot be read.
    """
    with atomic.file_errors("read", path), path.open("rb", buffering=0) as stream:
        size = os.fstat(stream.fileno()).st_size
        checksums = [zlib.crc32(os.pread(stream.fileno(), block, start)) for start in range(0, size, block)]
    return FileSeal(size, f"{zlib.crc32(np.array(checksums, '<u4').tobytes()):08x}")


def check(path: Path, expected: FileSeal, block: int = BLOCK) -> None:
    """Check that a file is the one of this seal.  Call on one rank.

    Raises:
        CaseError: it is not.
        FetiHomogError: it cannot be read.
    """
    with atomic.file_errors("read", path):
        size = os.stat(path).st_size
    if size != expected.bytes:
        raise CaseError(f"{path}: it is damaged, or of another run: it has {size} bytes, not {expected.bytes}")
    if seal(path, block).checksum != expected.checksum:
        raise CaseError(f"{path}: it is damaged, or of another run: its checksum is wrong")


def _checksum(text: str) -> str:
    return f"{zlib.crc32(text.encode('utf-8', 'surrogatepass')):08x}"


def _sealed(text: str, checksum: Any) -> str:
    """Return the text of a document with a last key, as `_text` would write it."""
    begin = "{" if text == "{}" else text.removesuffix("\n}") + ","
    return f'{begin}\n "{KEY}": {json.dumps(checksum)}\n}}\n'


def _text(content: Mapping[str, Any]) -> str:
    return json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False)
