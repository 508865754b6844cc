"""JSON documents with a checksum of their content, by which a changed one is told from the one that was written."""

from __future__ import annotations

import json
import zlib
from collections.abc import Mapping
from typing import Any

KEY = "checksum"


def dumps(document: Mapping[str, Any]) -> str:
    """The text of a document with, as its last key, the checksum of the others.  Raises ValueError for NaN."""
    content = {key: value for key, value in document.items() if key != KEY}
    return _text(content | {KEY: _checksum(content)}) + "\n"


def loads(text: str) -> dict[str, Any]:
    """The document of a text, without its checksum; one that has none is taken as it is.

    Raises:
        ValueError: it is not JSON, no table, or not what was written.
    """
    try:
        document = json.loads(text)
    except RecursionError as error:
        raise ValueError("it is nested too deeply") from error
    if not isinstance(document, dict):
        raise ValueError("it is damaged: no table of keys and values")
    if KEY in document and document.pop(KEY) != _checksum(document):
        raise ValueError("it is damaged: its checksum is wrong")
    return document


def _checksum(content: Mapping[str, Any]) -> str:
    return f"{zlib.crc32(_text(content).encode('utf-8', 'surrogatepass')):08x}"


def _text(content: Mapping[str, Any]) -> str:
    return json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False)
