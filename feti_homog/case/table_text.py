"""Lines of a table of fibres, as spreadsheets and other programs write them."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from feti_homog.errors import CaseError
from feti_homog.runtime import input_files

MAX_BYTES = 1 << 26
EMPTY = " \t\r,;"
"""Characters of a line without cells, as Excel writes them below a table."""
SEPARATOR = re.compile(r"sep=[,;\t]?")
"""First line that Excel reads."""
UNITS_OF_EXCEL = bytes.maketrans(b"\xb5\xb0\xb2", b"uo2")
"""Micro, degree and square in its code pages of Western Europe."""


def lines(path: Path) -> Iterator[tuple[int, str, str]]:
    """Yield the number of each line, its cells, empty if it has none, and what follows "#".

    Raises:
        CaseError: the file cannot be read, or is no text.
    """
    has_begun = False
    for number, line in enumerate(_text(path).splitlines(), 1):
        contents, _, comment = line.partition("#")
        is_empty = not contents.strip(EMPTY) or (not has_begun and SEPARATOR.fullmatch(contents.strip()) is not None)
        has_begun = has_begun or not is_empty
        yield number, "" if is_empty else contents, comment


def _text(path: Path) -> str:
    try:
        content = input_files.read(path, MAX_BYTES)
    except OSError as error:
        raise CaseError(f"{path.name}: cannot be read: {error.strerror}") from error
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        place = error.start
    try:
        return content.translate(UNITS_OF_EXCEL).decode()
    except UnicodeDecodeError as error:
        raise CaseError(f"{path.name}: expected text in UTF-8; it has other bytes at {place}") from error
