"""The checksums by which the files of a result are known to be those that its run wrote."""

from __future__ import annotations

import json
import os
import zlib
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from feti_homog.runtime import input_files

BLOCK = 1 << 26  # bytes


def is_as_written(document: Mapping[str, Any]) -> bool:
    """Return whether `checksum` in result.json is the CRC-32 of the rest, in the layout in which it is written."""
    content = {key: value for key, value in document.items() if key != "checksum"}
    text = json.dumps(content, indent=1, ensure_ascii=False)
    return bool(document.get("checksum") == f"{zlib.crc32(text.encode('utf-8', 'surrogatepass')):08x}")


def has_seal(path: Path, seal: object) -> bool:
    """Return whether a file has its size and the CRC-32 of the CRC-32s of its blocks, `result_h5` of result.json.

    Raises:
        OSError: it cannot be read.
    """
    with input_files.opened(path) as stream:
        size = os.fstat(stream.fileno()).st_size
        if not isinstance(seal, dict) or seal.get("bytes") != size:
            return False
        checksums = [zlib.crc32(block) for block in iter(partial(stream.read, BLOCK), b"")]
    whole = zlib.crc32(np.array(checksums, "<u4").tobytes())
    return seal == {"bytes": size, "checksum": f"{whole:08x}"}
