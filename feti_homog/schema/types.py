"""Value types in a case file: each in words, as a test, and as it is stored."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from feti_homog.schema.wording import toml_value

SMALLEST, LARGEST = 1e-100, 1e100
"""Magnitudes of numbers other than 0: no product of a few over- or underflows."""
Test = Callable[[Any], bool]
INF = "inf"
"""An infinite number in resolved cases, which are written as JSON."""
MAGNITUDES = f"; numbers other than 0 have magnitudes from {SMALLEST:g} to {LARGEST:g}"


@dataclass(frozen=True)
class ValueType:
    """A value's type.

    Attributes:
        expected: in words, for faults and for the reference.
        accepts: whether a value, of TOML's types, is valid.
        store: the form in which its table's dataclass keeps a valid value.
        table: the value's dataclass if it is a table; `TableReader` reads it.
        item: the entry type of a list with tables in it.
        options: of a choice, the texts that it may be.
    """

    expected: str
    accepts: Test
    store: Callable[[Any], Any]
    table: type[Any] | None = None
    item: ValueType | None = None
    options: tuple[str, ...] = ()

    def complaint(self, value: Any) -> str:
        """Return the expectation that a value fails, empty if it is valid."""
        return "" if self.accepts(value) else f"expected {self.expected}{magnitudes_in_words(value)}{_scatter(value)}"


def _scatter(value: Any) -> str:
    """Return a hint to `feti-homog uncertainty` for a value {mean, std} or {mean, cv}; else empty."""
    if isinstance(value, list):
        return next(filter(None, map(_scatter, value)), "")
    has_scatter = isinstance(value, dict) and set(value) in ({"mean", "std"}, {"mean", "cv"})
    return "; `feti-homog uncertainty` takes scatter" if has_scatter else ""


def magnitudes_in_words(value: Any) -> str:
    """Return the magnitude limits, where a number in a value is beyond them; else empty."""
    if isinstance(value, list | tuple):
        return next(filter(None, map(magnitudes_in_words, value)), "")
    is_of_type = isinstance(value, int | float) and not isinstance(value, bool)
    return MAGNITUDES if is_of_type and not is_number(value) and value == value else ""


def is_number(value: object) -> bool:
    """Return whether the value is a finite number of sensible magnitude (true and false are none)."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return value == 0 or SMALLEST <= abs(value) <= LARGEST


def real(**limits: float) -> ValueType:
    """Return a number within limits: `above` and `below` are outside, `least` and `most` inside."""
    return _within("a number", is_number, float, limits)


def integer(**limits: float) -> ValueType:
    """Return an integer within limits, as `real`."""
    return _within("an integer", lambda value: is_number(value) and isinstance(value, int), int, limits)


def _within(name: str, is_of_type: Test, store: Callable[[Any], Any], limits: Mapping[str, float]) -> ValueType:
    tests = {"above": operator.gt, "least": operator.ge, "below": operator.lt, "most": operator.le}
    words = {"above": "above", "least": "at least", "below": "below", "most": "at most"}
    finite = {kind: limits[kind] for kind in tests if math.isfinite(limits.get(kind, math.inf))}
    texts = {kind: str(limit) if isinstance(limit, int) else f"{limit:.6g}" for kind, limit in finite.items()}
    expected = f"{name} {' and '.join(f'{words[kind]} {text}' for kind, text in texts.items())}".strip()

    def accepts(value: Any) -> bool:
        return is_of_type(value) and all(tests[kind](value, limit) for kind, limit in finite.items())

    return ValueType(expected, accepts, store)


def list_of(
    item: ValueType, expected: str, *, least: int = 0, count: int | None = None, unique: bool = False
) -> ValueType:
    """Return a list of values of one type: at least so many or just so many, none twice if they are unique."""
    fewest = least if count is None else count

    def accepts(value: Any) -> bool:
        if not isinstance(value, list) or len(value) < fewest or (count is not None and len(value) > count):
            return False
        return all(map(item.accepts, value)) and not (unique and len({*value}) < len(value))

    return ValueType(expected, accepts, lambda value: tuple(map(item.store, value)), item=item if item.table else None)


def either(expected: str, *types: ValueType) -> ValueType:
    """Return a value that may have any of some types."""
    table = next((each.table for each in types if each.table is not None), None)
    return ValueType(
        expected,
        lambda value: any(each.accepts(value) for each in types),
        lambda value: next(each.store(value) for each in types if each.accepts(value)),
        table,
    )


def table_of(table: type[Any], expected: str, *, least: int = 0) -> ValueType:
    """Return a table with at least so many keys, which `TableReader` reads."""
    return ValueType(expected, lambda v: isinstance(v, dict) and len(v) >= least, lambda v: v, table)


def file_name(expected: str, *suffixes: str) -> ValueType:
    """Return a file name with one of some suffixes."""
    return ValueType(expected, lambda value: text.accepts(value) and value.endswith(suffixes), Path)


def choice(*options: str) -> ValueType:
    """One of some texts."""
    words = "one of " + ", ".join(map(toml_value, options))
    return ValueType(words, lambda value: value in options, str, options=options)


POSITIVE_OR_INF = ValueType(
    "a positive number, or inf", lambda value: value in (math.inf, INF) or (is_number(value) and value > 0), float
)
"""Where inf is another thing than no value."""
boolean = ValueType("true or false", lambda value: isinstance(value, bool), bool)
text = ValueType("a text in one line", lambda value: isinstance(value, str) and value.isprintable(), str)
