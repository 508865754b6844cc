"""Read the document of a case (nested dictionaries of TOML types) from a file, or from Python and NumPy values."""

import copy
import hashlib
import os
import re
import tomllib
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path, PurePath
from typing import Any

import numpy as np

from feti_homog.errors import CaseError
from feti_homog.schema import types, wording
from feti_homog.system.runtime import input_files

MAX_DEPTH = 50
MAX_BITS = 10_000  # of an integer: Python writes none of more than 4 300 digits into messages
DEEP_KEY = re.compile(rf"""(?<![\w-])((?>[\w-]+|"[^"\n]*"|'[^'\n]*')[ \t]*+\.[ \t]*+){{{MAX_DEPTH}}}""")
TOO_DEEP = f"tables and arrays are nested more than {MAX_DEPTH} deep"

TomlPath = tuple[str, ...]


def read_document(path: str | Path) -> dict[str, Any]:
    """Read a TOML file; its stem is the default `name`.  Raises CaseError if unreadable, too large or no TOML."""
    path = Path(path)
    if "\0" in str(path):
        raise CaseError(f"{str(path)!r}: no file has a name with a null character")
    try:
        content = input_files.read(path, types.MOST_BYTES, pipes=True).decode("utf-8-sig")
        if DEEP_KEY.search(content):
            raise RecursionError  # tomllib would take time proportional to the length squared
        document = tomllib.loads(content)
    except UnicodeDecodeError as error:
        line = error.object.count(b"\n", 0, error.start) + 1
        raise CaseError(f"{path}: not UTF-8 text (line {line})") from None
    except RecursionError:
        raise CaseError(f"{path}: {TOO_DEEP}") from None
    except ValueError as error:  # also for a number with too many digits
        place = f"line {content.count(chr(10)) + 1}, the end"
        words = str(error).replace("newline or end of document after a statement", "one statement a line")
        words, number = words.replace("end of document", place), re.search(r"at line (\d+), col", str(error))
        text = content.split("\n")[int(number[1]) - 1].strip() if number else ""
        hint = "; numbers have no unit, and a decimal point" if re.match(r"[^=]*=\s*[-+.]*\d[^=]*$", text) else ""
        if "overwrite" in words:
            hint = f"; {text.partition('=')[0].strip()} is given twice"
        elif "immutable namespace" in words:
            hint = f'; a section with a value has its keys in quotation marks: "{text.partition("=")[0].strip()}"'
        elif re.match(r"[^=]*=\s*[A-Za-z]", text):
            hint = "; text needs quotation marks, true and false do not"
        quoted = f": {wording.toml_value(text)}{hint}" if text else ""
        raise CaseError(f"{path}: not TOML: {words}{quoted}") from None
    except OSError as error:
        raise CaseError(f"{path}: cannot be read: {error.strerror}") from None
    # Without a UTF-8 locale, Python escapes the bytes of file names.
    return {"name": os.fsencode(path.stem).decode("utf-8", "replace")} | document


def to_document(values: object) -> dict[str, Any]:
    """Convert Python and NumPy values to TOML types.

    NumPy scalars become numbers, arrays and tuples become lists, paths become strings. Values of other types stay
    unchanged: `TableReader` reports them.

    Raises:
        TypeError: the values are not a mapping.
        CaseError: a key is not a string, an integer is too large for messages, or a table or list is too long or deep.
    """
    if not isinstance(values, Mapping):
        expected = "expected the sections of a case as a dictionary, such as tomllib.load returns"
        raise TypeError(f"{expected}; got {_article(values)}")
    faults: list[str] = []
    document: dict[str, Any] = _to_toml(values, (), faults)
    if faults:
        raise CaseError(*faults)
    return document


def _to_toml(value: Any, path: TomlPath, faults: list[str], depth: int = 0) -> Any:
    if type(value) in (float, str, bool) or (type(value) is int and value.bit_length() <= MAX_BITS):
        return value  # most values; other types, such as NumPy scalars, follow
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, Mapping | list | tuple):
        most, noun = (types.MOST_KEYS, "keys") if isinstance(value, Mapping) else (types.MOST_ENTRIES, "entries")
        if depth > MAX_DEPTH or len(value) > most:
            words = TOO_DEEP if depth > MAX_DEPTH else f"{len(value)} {noun}; expected at most {most}"
            raise CaseError(f"{wording.dotted_key(path) or 'the file'}: {words}")
    if isinstance(value, Mapping):
        place = f"[{wording.dotted_key(path)}] " if path else ""
        wrong = [name for name in value if not isinstance(name, str)]
        faults += [f"{place}{name!r}: expected a string as key, not {_article(name)}" for name in wrong]
        named = ((str(name), entry) for name, entry in value.items() if isinstance(name, str))
        return {name: _to_toml(entry, (*path, name), faults, depth + 1) for name, entry in named}
    if isinstance(value, list | tuple):
        return [_to_toml(entry, path, faults, depth + 1) for entry in value]
    if isinstance(value, int) and value.bit_length() > MAX_BITS:
        faults.append(f"{wording.dotted_key(path)}: expected no integer of more than {MAX_BITS} bits")
    if isinstance(value, np.floating):
        return float(value)
    if isinstance(value, np.generic):
        return value.item()
    return str(value) if isinstance(value, PurePath) else value


def leaves(
    table: Mapping[str, Any], is_value: Callable[[TomlPath, Any], bool] | None = None, above: TomlPath = ()
) -> Iterator[tuple[TomlPath, Any]]:
    """Yield the path and the value of each leaf in a nested table; every path begins with `above`.

    A key "a.b" gives two names in the path. An empty table, or a table with is_value(path, table), is a leaf.
    """
    for name, value in table.items():
        path = (*above, *name.split("."))
        if isinstance(value, dict) and value and not (is_value and is_value(path, value)):
            yield from leaves(value, is_value, path)
        else:
            yield path, value


def is_key(path: TomlPath) -> bool:
    """Return whether a path names a key, such as `load.to`, and not a section, such as `material.fibre`."""
    return path[:-1] not in ((), ("material",), ("interface",))


def in_lists(path: TomlPath) -> TomlPath:
    """Replace the name "Cij" at the end of a stiffness path by row "i" and column "j"; return other paths unchanged."""
    entry = re.fullmatch(r"C([1-6])([1-6])", path[-1]) if path[-2:-1] == ("stiffness",) else None
    return path if entry is None else (*path[:-1], *entry.groups())


def with_values(
    base: Mapping[str, Any], values: Mapping[TomlPath, Any], faults: list[str], place: str = ""
) -> dict[str, Any]:
    """Return a copy of a document with other values at some paths.

    A table is merged into a section, but replaces the table of a key.  None removes a key, a missing section is
    created.  A number, from 1, selects one of several sections or an entry of a list; "Cij" sets C_ij and C_ji of a
    stiffness.  The first fault appends a line that begins with `place` to `faults`, and leaves out the later values.
    """
    document = copy.deepcopy(dict(base))
    for path, value in values.items():
        entry = in_lists(path)[len(path) - 1 :]
        for *above, last in dict.fromkeys([(*path[:-1], *entry), (*path[:-1], *entry[::-1])]):
            table: Any = document
            for name in above:
                table = _one_of(table, name)
                if isinstance(table, list):
                    table = table[int(name) - 1] if name.isdecimal() and 0 < int(name) <= len(table) else None
                else:
                    table = table.setdefault(name, {})
                if not isinstance(table, dict | list):
                    faults.append(f"{place}{wording.dotted_key(path)}: {wording.toml_value(name)} is not a section")
                    return document
            table, name = _one_of(table, last), wording.dotted_key(above)
            if isinstance(table, list):
                several = f"there are {len(table)} sections [[{name}]]; expected {name}.1.{last} or the like"
                if not any(isinstance(each, dict) for each in table):
                    several = f"expected {name}.1 to {name}.{len(table)}"
                    if last.isdecimal() and 0 < int(last) <= len(table):
                        table[int(last) - 1] = value
                        continue
                faults.append(f"{place}{wording.dotted_key(path)}: {several}")
                return document
            is_merged = isinstance(value, dict) and isinstance(table.get(last, {}), dict) and not is_key(path)
            table[last] = table.get(last, {}) | value if is_merged else value
            if value is None:
                del table[last]
    return document


def _one_of(table: Any, name: str) -> Any:
    """Return the only entry of a list if a path, which continues with `name`, omits its number; else return `table`."""
    is_one = isinstance(table, list) and len(table) == 1
    return table[0] if is_one and isinstance(table[0], list if name.isdecimal() else dict | list) else table


def short_digest(content: bytes) -> str:
    """Return the first 16 hexadecimal digits of the SHA-256 digest of `content`."""
    return hashlib.sha256(content).hexdigest()[:16]


def _article(value: object) -> str:
    """Return the type name of a value with its article: "an int", "a list"."""
    name = type(value).__name__
    return f"{'an' if name[0] in 'aeiou' else 'a'} {name}"
