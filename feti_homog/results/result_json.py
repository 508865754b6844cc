"""Read and write result.json, write points as CSV tables and event logs, and seal files by checksums.

Each file but the event log is written completely or not at all.  A checksum in a JSON document, or in result.json for
result.h5, reveals damage and edits.  HDF5 may crash on wrong bytes, so readers check that file before they open it.
"""

import contextlib
import csv
import io
import json
import math
import os
import re
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, is_dataclass
from pathlib import Path
from typing import Any, NamedTuple, TextIO, get_type_hints

import numpy as np

from feti_homog import __version__
from feti_homog.errors import CaseError, FetiHomogError
from feti_homog.results import atomic
from feti_homog.system.runtime import described, input_files, records
from feti_homog.typing import Intracomm

NAME = "result.json"
KEY = "checksum"
BLOCK = 1 << 26  # bytes of one read
ENCODE = json.JSONEncoder(ensure_ascii=False, allow_nan=False).encode
LOG = "events.log"  # one line for each event, for users to follow a running path
LOG_HEADER = "# feti-homog: events"  # beginning of the first line, which identifies a log of this program
SCHEMA = 1  # version of the layout: raise when a key changes name or meaning, or disappears


def write(directory: Path, document: Mapping[str, Any]) -> Path:
    """Write `directory`/result.json, create the folder if needed, and return the file path.  Call on one rank.

    NumPy arrays and scalars become lists and numbers, tuples lists, paths strings.  The file is replaced in one step: a
    reader finds the old document or the new one.

    Raises:
        FetiHomogError: a number is not finite (one line for each, with its place in the document), or the file cannot
            be written.
        TypeError: a value has no JSON type.
    """
    text, path = text_of(document), Path(directory) / NAME
    with atomic.file_errors("write", path):
        path.parent.mkdir(parents=True, exist_ok=True)
    return atomic.replace_text(path, text)


def text_of(document: Mapping[str, Any]) -> str:
    """Serialize a document with its checksum, as text for `loads`.  Conversions and their errors are as in `write`."""
    faults = list[str]()
    content = _json_value(document, "", faults)
    if faults:
        raise FetiHomogError(*faults)
    return dumps(content)


def read(directory: Path) -> dict[str, Any]:
    """Return the document of `directory`/result.json, without its checksum.

    Raises:
        CaseError: the file is missing, is not a JSON table or has changed, or its layout has another version.
        FetiHomogError: the file has no read permission.
    """
    path = Path(directory) / NAME
    try:
        document = loads(input_files.read(path).decode("utf-8"))
    except OSError as error:
        raise input_files.unreadable(path, error) from error
    except ValueError as error:
        raise CaseError(f"cannot read {path}: {error}") from error
    entry = document.get("schema", "none")
    if entry != SCHEMA:
        raise CaseError(f"{path}: its schema is {entry}, this program reads schema {SCHEMA}; run the case again")
    return document


def _json_value(value: Any, place: str, faults: list[str]) -> Any:
    """Convert the value at `place` in a document to JSON types; append a line to `faults` for each non-finite number.

    Raises TypeError, with the place, for a value without a JSON type.
    """
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, Mapping):
        return {key: _json_value(item, f"{place}.{key}".lstrip("."), faults) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_json_value(item, f"{place}[{i}]", faults) for i, item in enumerate(value)]
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if value is None or isinstance(value, bool | int | float | str):
        if isinstance(value, float) and not math.isfinite(value):
            faults.append(f"{NAME}: {place} is {value}, not a finite number")
        return value
    raise TypeError(f"{NAME}: {place} is a {type(value).__name__}, which JSON cannot hold")


class DescribedColumn(NamedTuple):
    """The name, unit and meaning of a column in a CSV file."""

    name: str
    unit: str
    meaning: str


def columns(kind: type) -> Iterator[DescribedColumn]:
    """Yield a column for each number, text and array component in records of class `kind`, with unit and meaning."""
    for name, description in _in_columns(kind).items():
        # The components in the plane are among the spatial components, in the same order.
        for component in description.spatial_components or description.components or (name,):
            sentence = f"{component}, {description.meaning}" if description.components else description.meaning
            yield DescribedColumn(component, description.unit, sentence)


def write_csv(path: Path, points: Sequence[Any]) -> Path:
    """Write a CSV table with a row for each record in `points`, and return the path.  Call on one rank.

    The records have one class.  Columns are numbers, strings and array components; empty columns, other arrays and
    nested records are left out.  Raises FetiHomogError if the table cannot be written.
    """
    fields = _in_columns(type(points[0])) if points else {}
    rows = []
    for point in points:
        row: dict[str, Any] = {}
        for name, value in records.plain(point).items():
            if name in fields:
                values, components = np.ravel(value).tolist(), fields[name].components or (name,)
                components = fields[name].spatial_components if len(values) > len(components) else components
                row |= dict(zip(components, values, strict=True))
        rows.append(row)
    present = {name for row in rows for name in row}
    names = [column.name for column in columns(type(points[0])) if column.name in present] if rows else []
    return atomic.replace_text(path, csv_text([names, *(map(row.get, names) for row in rows)], "\r\n"))


def _in_columns(kind: type) -> dict[str, records.Description]:
    """Return descriptions of the record fields that fill columns: numbers, strings, arrays with named components."""
    hints = get_type_hints(kind)
    entry = {name: d for name, d in records.descriptions(kind).items() if d.components or not d.shape}
    return {name: d for name, d in entry.items() if not is_dataclass(records.without_none(hints[name]))}


def csv_text(rows: Iterable[Iterable[Any]], end: str = "\n") -> str:
    """Return rows as CSV with line ends `end`.  An apostrophe precedes strings that a spreadsheet would evaluate."""
    stream, formula = io.StringIO(newline=""), re.compile(r"[=@]|[+-](?![0-9.]+([eE][+-][0-9]+)?$)")
    texts = ([f"'{cell}" if isinstance(cell, str) and formula.match(cell) else cell for cell in row] for row in rows)
    csv.writer(stream, lineterminator=end).writerows(texts)
    return stream.getvalue()


class EventLog:
    """The event log in a result folder, which rank 0 writes.

    The first line replaces an earlier log.  After a write error, `say` gets a warning, and later lines are dropped.
    """

    def __init__(self, directory: Path, comm: Intracomm, title: str, say: Callable[[str], object]) -> None:
        self.path, self._title, self._say = directory / LOG, title, say
        self._wanted = comm.rank == 0
        self._stream: TextIO | None = None

    def write(self, line: str) -> None:
        """Append a line to the log.  Other ranks, and calls after `close`, write nothing."""
        if not self._wanted:
            return
        try:
            with atomic.file_errors("write", self.path):
                if self._stream is None:
                    if self.path.is_fifo():  # opening a pipe would wait for a reader
                        self.path.unlink()
                    self._stream = self.path.open("w", encoding="utf-8", buffering=1)  # whole lines
                    print(f"{LOG_HEADER} of {self._title}, version {__version__}", file=self._stream)
                print(line.strip(), file=self._stream)
        except FetiHomogError as error:
            self._say(f"warning: {error}; the path goes on without it")
            self.close()

    def close(self) -> None:
        """Close the log, so that `write` ignores later lines."""
        self._wanted = False
        if self._stream is not None:
            with contextlib.suppress(OSError):  # the stream has no unwritten line
                self._stream.close()


def dumps(document: Mapping[str, Any]) -> str:
    """Serialize a document, with its checksum as last key.  Raises ValueError for NaN and infinities."""
    text = _text({key: value for key, value in document.items() if key != KEY})
    return _sealed(text, _checksum(text))


def loads(text: str) -> dict[str, Any]:
    """Parse a document, verify its checksum, if any, and remove the checksum.

    Raises ValueError if the text is not JSON or not a table, or does not match its checksum.
    """
    try:
        document = json.loads(text)
        if not isinstance(document, dict):
            raise ValueError("it is damaged: no table of keys and values")
        if KEY not in document:
            last_key, last = next(reversed(document.items()), ("", None))
            rest = {key: value for key, value in document.items() if key != last_key}
            if isinstance(last, str) and len(last) == 8 and last == _checksum(_text(rest)):
                raise ValueError("it is damaged: the key of its checksum has another name")
            return document
        stored = document.pop(KEY)
        end = _sealed("{\n}", stored)[1:]
        if text.endswith(end) and _checksum(text[: -len(end)] + "\n}") == stored:  # the text is unchanged
            return document
        if stored != _checksum(_text(document)):
            raise ValueError("it is damaged: its checksum is wrong")
        return document
    except RecursionError as error:
        raise ValueError("it is nested too deeply") from error


@dataclass(frozen=True)
class FileSeal:
    """The size and checksum of a file."""

    bytes: int = described("size", records.BYTES)
    checksum: str = described("CRC-32, in hexadecimal, of the CRC-32s (32 bits, little-endian) of its blocks of 64 MiB")


def seal(path: Path, block: int = BLOCK) -> FileSeal:
    """Return the size and checksum of a file, read in blocks of `block` bytes.

    Call on the rank that completed the file: other ranks may still see an earlier file of that name.  Raises
    FetiHomogError if the file cannot be read.
    """
    with atomic.file_errors("read", path), path.open("rb", buffering=0) as stream:
        size = os.fstat(stream.fileno()).st_size
        checksums = [zlib.crc32(os.pread(stream.fileno(), block, start)) for start in range(0, size, block)]
    return FileSeal(size, f"{zlib.crc32(np.array(checksums, '<u4').tobytes()):08x}")


def check(path: Path, expected: FileSeal, block: int = BLOCK) -> None:
    """Compare a file with the `expected` size and checksum, from blocks of `block` bytes.  Call on one rank.

    Raises CaseError if size or checksum differ, FetiHomogError if the file cannot be read.
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
    """Insert the checksum, as last key, into a document serialized by `_text`."""
    begin = "{" if text == "{}" else text.removesuffix("\n}") + ","
    return f'{begin}\n "{KEY}": {json.dumps(checksum)}\n}}\n'


def _text(value: Any, begin: str = "\n ") -> str:
    """Serialize a value; lines inside begin with `begin`.  An array of numbers, or a matrix row, takes one line."""
    if isinstance(value, dict) and value:
        lines = [f"{ENCODE(key)}: {_text(item, begin + ' ')}" for key, item in value.items()]
        return f"{{{begin}{(',' + begin).join(lines)}{begin[:-1]}}}"
    if isinstance(value, list | tuple) and any(isinstance(item, dict | list | tuple | str) for item in value):
        return f"[{begin}{(',' + begin).join(_text(item, begin + ' ') for item in value)}{begin[:-1]}]"
    return ENCODE(value)
