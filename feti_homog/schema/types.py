"""Define the types of values in a case file (description, test, stored form), and limits of files and lists.

The limits let the program check each case file or table in less than ten seconds.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from feti_homog.schema.wording import suggestion, toml_value

SMALLEST, LARGEST = 1e-100, 1e100
"""Limits for magnitudes of numbers other than 0, so that products of a few numbers neither overflow nor underflow."""
MOST_BYTES = 1 << 22  # in a case file: tomllib reads 1 to 3 MB a second
MOST_KEYS, MOST_ENTRIES = 10_000, 100_000  # in a table, in a list
MOST_FIBRES = 100_000  # in a cell; a table has up to twice this number of rows, fibres and voids
MOST_ROWS = 10_000  # arcs, waypoints, points of a curve, cases of a sweep: 50 to 500 us each
MOST_SECTIONS = 1000  # [[interface]], for pairs among 45 phases; [[test]]; uncertain numbers
MOST_PIXELS = 100 * MOST_FIBRES  # in an image: two triangles each
Test = Callable[[Any], bool]
INF = "inf"
"""The text for an infinite number in resolved cases, because JSON has no infinity."""
MAGNITUDES = f"; numbers other than 0 have magnitudes from {SMALLEST:g} to {LARGEST:g}"


@dataclass(frozen=True)
class ValueType:
    """The type of a value.

    Attributes:
        expected: description in messages and in the reference.
        accepts: test whether a TOML value is valid.
        store: conversion of a valid value to the form in the dataclass.
        table: dataclass of a table, which `TableReader` reads; None for other values.
        item: type of the entries of a list with tables; None for other values.
        options: valid strings of a choice; else empty.
    """

    expected: str
    accepts: Test
    store: Callable[[Any], Any]
    table: type[Any] | None = None
    item: ValueType | None = None
    options: tuple[str, ...] = ()

    def complaint(self, value: Any) -> str:
        """Return "expected ..." for an invalid value, an empty string for a valid value."""
        if self.accepts(value):
            return ""
        complaint = f"expected {self.expected}{hint(value)}"
        if not self.options or not isinstance(value, str):
            return complaint
        advice = suggestion(value, self.options, {})
        return complaint if advice.startswith("expected") else f"{complaint}; {advice}"


def hint(value: Any) -> str:
    """Return a hint on a value, or an entry of a list, with scatter or beyond the limits; otherwise an empty string."""
    if isinstance(value, list | tuple):
        return next(filter(None, map(hint, value)), "")
    if has_scatter(value):
        return "; `feti-homog uncertainty` takes scatter"
    is_of_type = isinstance(value, int | float) and not isinstance(value, bool)
    return MAGNITUDES if is_of_type and not is_number(value) and value == value else ""  # NaN differs from itself


def has_scatter(value: Any) -> bool:
    """Return whether a value is a number with scatter, as `feti-homog uncertainty` takes it."""
    return isinstance(value, dict) and set(value) in ({"mean", "std"}, {"mean", "cv"})


def is_number(value: Any) -> bool:
    """Return whether a value is a number (not a truth value) within the magnitude limits."""
    is_of_type = isinstance(value, int | float) and not isinstance(value, bool)
    return is_of_type and (value == 0 or SMALLEST <= abs(value) <= LARGEST)


def real(**limits: float) -> ValueType:
    """Return the type of numbers within limits: `above` < number < `below`, `least` <= number <= `most`."""
    return _within("a number", is_number, float, limits)


def integer(**limits: float) -> ValueType:
    """Return the type of integers within limits; see `real`."""
    return _within("an integer", lambda value: is_number(value) and isinstance(value, int), int, limits)


def _within(name: str, is_of_type: Test, store: Callable[[Any], Any], limits: Mapping[str, float]) -> ValueType:
    """Return the type of numbers that pass `is_of_type` and `limits` (see `real`); messages call them `name`."""
    kinds = {"above": operator.gt, "at least": operator.ge, "below": operator.lt, "at most": operator.le}
    bounds = [(words, limits.get(words.split()[-1], math.inf)) for words in kinds]
    finite = [(words, limit) for words, limit in bounds if math.isfinite(limit)]
    texts = [f"{words} {limit if isinstance(limit, int) else f'{limit:.6g}'}" for words, limit in finite]

    def accepts(value: Any) -> bool:
        return is_of_type(value) and all(kinds[words](value, limit) for words, limit in finite)

    return ValueType(f"{name} {' and '.join(texts)}".strip(), accepts, store)


def list_of(
    item: ValueType, expected: str, *, least: int = 0, most: int = 0, count: int | None = None, unique: bool = False
) -> ValueType:
    """Return the type of lists whose entries have the type `item`, stored as tuples.

    A list has at least `least` and, unless 0, at most `most` entries, or exactly `count`; with `unique`, all differ.
    """
    fewest, largest = (least, most or math.inf) if count is None else (count, count)
    expected += f", at most {most} of them" if most else ""

    def accepts(value: Any) -> bool:
        if not isinstance(value, list) or not fewest <= len(value) <= largest or not all(map(item.accepts, value)):
            return False
        return not unique or len(set(value)) == len(value)

    return ValueType(expected, accepts, lambda value: tuple(map(item.store, value)), item=item if item.table else None)


def either(expected: str, *types: ValueType) -> ValueType:
    """Return the type of values that one of several types accepts; the first such type converts a value."""
    table = next((kind.table for kind in types if kind.table is not None), None)
    return ValueType(
        expected,
        lambda value: any(kind.accepts(value) for kind in types),
        lambda value: next(kind.store(value) for kind in types if kind.accepts(value)),
        table,
    )


def table_of(table: type[Any], expected: str, *, least: int = 0) -> ValueType:
    """Return the type of tables with `least` keys or more; `TableReader` reads them into the class `table`."""
    accepts = lambda value: isinstance(value, dict) and len(value) >= least and not has_scatter(value)  # noqa: E731
    return ValueType(expected, accepts, lambda value: value, table)


def file_name(expected: str, *suffixes: str) -> ValueType:
    """Return the type of file names with one of the `suffixes`, in upper or lower case."""
    return ValueType(expected, lambda value: text.accepts(value) and value.lower().endswith(suffixes), Path)


def choice(*options: str) -> ValueType:
    """Return the type of strings that equal one of the `options`."""
    words = "one of " + ", ".join(map(toml_value, options))
    return ValueType(words, lambda value: value in options, str, options=options)


POSITIVE_OR_INF = ValueType(
    "a positive number, or inf", lambda value: value in (math.inf, INF) or (is_number(value) and value > 0), float
)
"""The type of positive numbers and inf, for keys where inf differs from a missing value."""
boolean = ValueType("true or false", lambda value: isinstance(value, bool), bool)
text = ValueType("a string in one line", lambda value: isinstance(value, str) and value.isprintable(), str)
