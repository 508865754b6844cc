"""Keyword lines, data lines, numbers and names of an Abaqus input file."""

from __future__ import annotations

import re
from collections.abc import Iterator

from feti_homog.schema.wording import toml_value


def blocks(text: str) -> Iterator[tuple[int, dict[str, str], list[list[str]]]]:
    """Yield the keyword lines with their number, their words (the keyword under ""), and the data lines that follow."""
    number, words, rows = 0, dict[str, str](), list[list[str]]()
    open_line = ""
    for place, line in enumerate(text.splitlines(), start=1):
        line = line.strip()
        if not line or line.startswith("**"):
            continue
        if line.startswith("*") or open_line.startswith("*"):
            open_line += line
            if open_line.endswith(","):
                continue
            if words:
                yield number, words, rows
            number, words, rows, open_line = place, _words(open_line), [], ""
        elif words:
            rows.append([word.strip() for word in line.rstrip(", \t").split(",")])
    if words:
        yield number, words, rows


def _words(line: str) -> dict[str, str]:
    """Keyword and parameters of a line: *ELEMENT, TYPE=CPE3 has {"": "ELEMENT", "TYPE": "CPE3"}."""
    keyword, *parameters = (word.strip() for word in line[1:].split(","))
    pairs = (word.partition("=") for word in parameters)
    return {"": re.sub(r"\s+", " ", keyword.upper()), **{k.strip().upper(): name_of(v) for k, _, v in pairs}}


def integer(word: str) -> int:
    """Return the whole number that a word is; ValueError if it is none."""
    if not re.fullmatch(r"[+-]?[0-9]{1,15}", word):
        raise ValueError(f"{toml_value(word)}: expected a whole number of at most 15 digits")
    return int(word)


def real(word: str) -> float:
    """Return the number that a word is; ValueError if it is none."""
    try:
        if "_" not in word and word.isascii():
            return float(word)
    except ValueError:
        pass
    raise ValueError(f"{toml_value(word)}: expected a number")


def name_of(word: str) -> str:
    """Return the name that a word is, in lower case unless it is quoted."""
    word = word.strip()
    return word[1:-1] if word[:1] == '"' else word.lower()
