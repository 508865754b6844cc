"""Read the tables of a case file into dataclasses; each field holds the rules of its key."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from feti_homog.errors import MOST_FAULTS
from feti_homog.schema.types import INF, ValueType
from feti_homog.schema.wording import suggestion, toml_key, toml_value

T = TypeVar("T")


@dataclass(frozen=True)
class Selector:
    """A key of `section` that decides which other keys belong to the case; messages call it `word`, if not empty."""

    section: str
    key: str
    word: str = ""

    def among(self, *values: str) -> Condition:
        """Return the condition that the selector has one of the `values`."""
        return Condition(self, values)


@dataclass(frozen=True)
class Condition:
    """The condition that a selector has one of the `values`."""

    selector: Selector
    values: tuple[str, ...]

    def holds(self, selected: Selected) -> bool:
        """Return whether the selector has one of the values; False if its value is faulty or missing."""
        return selected.get(self.selector) in self.values

    def in_words(self, section: str) -> str:
        """Write "KEY = A or B"; "[SECTION] KEY = A or B" for a message about another `section` than the selector's."""
        word = self.selector.word or self.selector.key
        name = word if section == self.selector.section else f"[{self.selector.section}] {word}"
        return f"{name} = {' or '.join(map(toml_value, self.values))}"


Selected = Mapping[Selector, str | None]
"""The value of every selector; None for a faulty value, which turns off all checks that depend on the selector."""


@dataclass(frozen=True)
class Key:
    """A key of a table.

    Attributes:
        type: type of the value.
        meaning: one or two sentences for the reference.
        unit: unit symbol, empty without a unit.
        default: default value, or meaning of a missing key, in words; may be empty.
        only: conditions; the key belongs to a table if all conditions hold.
        required: whether a table must have the key if all conditions hold.
        instead: hint to another key for tables where a condition fails, or empty.
        unless: other keys of the table; a table with one of them does not need the key.
        by_pair: whether sections [[interface]] may have different values of the key.
        presentation: whether the key changes only the appearance of results, and no number.
    """

    type: ValueType
    meaning: str
    unit: str = ""
    default: str = ""
    only: tuple[Condition, ...] = ()
    required: bool = False
    instead: str = ""
    unless: tuple[str, ...] = ()
    by_pair: bool = False
    presentation: bool = False

    def fault(self, name: str, table: Mapping[str, Any]) -> str:
        """Return the fault of the key `name` in a table; an empty string without a fault.

        The text follows the name in a message. `only` is not checked; keys with conditions may be missing.
        """
        if name not in table:
            return f": missing; expected {self.type.expected}" if self.required and not self.only else ""
        words = self.type.complaint(table[name])
        return f" = {toml_value(table[name])}: {words}" if words else ""


def key(
    type_: ValueType,
    meaning: str,
    *,
    default: Any = dataclasses.MISSING,
    default_words: str = "",
    absent: str = "",
    only: Condition | tuple[Condition, ...] = (),
    **attributes: Any,
) -> Any:
    """Return a dataclass field that holds the rules of the key with the field name.

    Without `default` and `absent`, the key is required.  `absent` words the meaning of a missing key, whose value is
    then None; a key that is required under conditions has None, too.  `default_words` replace the default in the
    reference.  `attributes` are further attributes of `Key`.
    """
    conditions = only if isinstance(only, tuple) else (only,)
    default = None if absent else default
    required = default is dataclasses.MISSING
    words = absent or default_words
    if not words and not required and default is not None:
        words = toml_value(default)
    entry = Key(type_, meaning, default=words, only=conditions, required=required, **attributes)
    return dataclasses.field(default=None if required and conditions else default, metadata={"key": entry})


def keys_of(table_class: type[Any]) -> dict[str, Key]:
    """Return the keys of a table class by name; fields that are no keys are left out."""
    return {entry.name: entry.metadata["key"] for entry in dataclasses.fields(table_class) if "key" in entry.metadata}


@dataclass
class TableReader:
    """A reader of tables that collects their faults.

    Attributes:
        selected: values of the selectors.
        owners: sections of every key, in words, for hints about keys that are in a wrong table.
        faults: one line for every fault.
    """

    selected: Selected = field(default_factory=dict)
    owners: Mapping[str, str] = field(default_factory=dict)
    faults: list[str] = field(default_factory=list)

    def read(self, table_class: type[T], table: object, section: str, prefix: str = "") -> T | None:
        """Convert a table to an instance of `table_class`; return None if the table is faulty.

        Every fault, also in a nested table, adds a line to `faults`, which names `section`, `prefix` and key.
        """
        if not isinstance(table, dict):
            self.faults.append(f"{section} = {toml_value(table)}: expected a section [{section}]")
            return None
        keys, before = keys_of(table_class), len(self.faults)
        unknown = [name for name in table if name not in keys]
        faults = dict.fromkeys(unknown, "")
        worded = max(MOST_FAULTS + 1 - before, 0)  # further faults are only counted
        for name in unknown[:worded]:
            faults[name] = f" = {toml_value(table[name])}: unknown key; {suggestion(name, keys, self.owners)}"
        for name, entry in keys.items():
            fault = entry.fault(name, table)
            if fault:
                faults[name] = fault
        self.faults += [f"[{section}] {prefix}{toml_key(name)}{words}" for name, words in faults.items()]
        good = {name: value for name, value in table.items() if name not in faults}
        values = {k: self._stored(keys[k].type, value, section, f"{prefix}{k}") for k, value in good.items()}
        return table_class(**values) if len(self.faults) == before else None

    def _stored(self, type_: ValueType, value: Any, section: str, place: str) -> Any:
        """Convert a valid value to the stored form, and read the tables in it; None for a faulty table."""
        if type_.item is not None:
            return tuple(self._stored(type_.item, item, section, f"{place}[{k}]") for k, item in enumerate(value))
        if type_.table is not None and isinstance(value, dict):
            return self.read(type_.table, value, section, f"{place}.")
        return type_.store(value)


def to_table(instance: Any, selected: Selected) -> dict[str, Any]:
    """Convert an instance to a table of TOML values, as the inverse of `TableReader.read`.

    Keys with the value None, and keys with a condition that `selected` violates, are left out; inf becomes INF.
    """

    def to_toml(value: Any) -> Any:
        if isinstance(value, tuple):
            return [to_toml(entry) for entry in value]
        if isinstance(value, Path):
            return str(value)
        if value == math.inf:
            return INF
        return to_table(value, selected) if dataclasses.is_dataclass(value) else value

    table = {}
    for name, entry in keys_of(type(instance)).items():
        value = getattr(instance, name)
        if value is not None and all(condition.holds(selected) for condition in entry.only):
            table[name] = to_toml(value)
    return table
