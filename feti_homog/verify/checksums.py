"""The checksums by which the files of a result are known to be those that its run wrote."""

from __future__ import annotations

import json
import zlib
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

BLOCK = 1 << 26  # bytes


def is_as_written(document: Mapping[str, Any]) -> bool:
    """Return whether `checksum` in result.json is the CRC-32 of the rest, in the layout in which it is written."""
    content = {key: value for key, value in document.items() if key != "checksum"}
    text = json.dumps(content, indent=1, ensure_ascii=False)
    return bool(document.get("checksum") == f"{zlib.crc32(text.encode('utf-8', 'surrogatepass')):08x}")


def seal_of(path: Path) -> dict[str, Any]:
    """Size of a file, and the CRC-32 of the CRC-32s of its blocks, as `result_h5` in result.json says them."""
    with path.open("rb") as stream:
        checksums = [zlib.crc32(block) for block in iter(partial(stream.read, BLOCK), b"")]
    whole = zlib.crc32(np.array(checksums, "<u4").tobytes())
    return {"bytes": path.stat().st_size, "checksum": f"{whole:08x}"}
