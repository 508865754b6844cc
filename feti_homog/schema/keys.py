"""Read case file tables into frozen dataclasses, whose fields hold the rules of their keys."""

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
    """A key whose value decides which other keys belong to the case.

    `word` is the key name in messages, if different.
    """

    section: str
    key: str
    word: str = ""

    def among(self, *values: str) -> Condition:
        """Return the condition that the selector has one of these values."""
        return Condition(self, values)


@dataclass(frozen=True)
class Condition:
    """The condition that a selector has one of several values."""

    selector: Selector
    values: tuple[str, ...]

    def holds(self, selected: Selected) -> bool:
        """Return whether the condition holds; False if the selector is faulty."""
        return selected.get(self.selector) in self.values

    def in_words(self, section: str) -> str:
        """Write the condition for a fault in a section."""
        word = self.selector.word or self.selector.key
        name = word if section == self.selector.section else f"[{self.selector.section}] {word}"
        return f"{name} = {' or '.join(map(toml_value, self.values))}"


Selected = Mapping[Selector, str | None]
"""The value of each selector; None if faulty, which turns off all checks that depend on the selector."""


@dataclass(frozen=True)
class Key:
    """A key of a table.

    Attributes:
        type: type of the value.
        meaning: one or two sentences for the reference.
        unit: unit symbol, may be empty.
        default: default value in words, may be empty.
        only: conditions; the key belongs to the table if all hold.
        required: whether a table must have the key if the conditions hold.
        instead: replacement if a condition fails, may be empty.
        unless: other table keys, any of which makes the key optional.
        by_pair: whether several [[interface]] sections may differ in the key.
        presentation: whether the key changes only how results look, and no number.
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
        """Return the fault of the key in a table, empty if there is none.

        Conditions on other sections are not checked.
        """
        if name not in table:
            return f": missing; expected {self.type.expected}" if self.required and not self.only else ""
        words = self.type.complaint(table[name])
        return words and f" = {toml_value(table[name])}: {words}"


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
    """Return a dataclass field for the key of the same name.

    A key with neither `default` nor `absent` is required. `absent` describes what a missing key means, whose value is
    None; `default_words` describe a default. `attributes` are further `Key` attributes.
    """
    conditions = only if isinstance(only, tuple) else (only,)
    default = None if absent else default
    required = default is dataclasses.MISSING
    written = toml_value(list(default) if isinstance(default, tuple) else default)
    words = absent or default_words or ("" if required or default is None else written)
    entry = Key(type_, meaning, default=words, only=conditions, required=required, **attributes)
    return dataclasses.field(default=None if required and conditions else default, metadata={"key": entry})


def keys_of(table_class: type[Any]) -> dict[str, Key]:
    """Return the keys of a table class by name; derived fields are left out."""
    return {each.name: each.metadata["key"] for each in dataclasses.fields(table_class) if "key" in each.metadata}


@dataclass
class TableReader:
    """A reader of tables that gathers their faults.

    Attributes:
        selected: values of the selectors.
        owners: sections of each key, in words, to place keys that are unknown in a table.
        faults: one line for each fault.
    """

    selected: Selected = field(default_factory=dict)
    owners: Mapping[str, str] = field(default_factory=dict)
    faults: list[str] = field(default_factory=list)

    def read(self, table_class: type[T], table: object, section: str, prefix: str = "") -> T | None:
        """Return the table as a `table_class` instance; None if the table is faulty.

        Each fault adds a line to `faults`, where `prefix` precedes the table keys within a section.
        """
        if not isinstance(table, dict):
            self.faults.append(f"{section} = {toml_value(table)}: expected a section [{section}]")
            return None
        keys, before = keys_of(table_class), len(self.faults)
        faults = {
            name: f" = {toml_value(table[name])}: unknown key; "
            + (suggestion(name, keys, self.owners) if before < MOST_FAULTS else "")  # slow, and not to be seen
            for name in table
            if name not in keys
        }
        faults |= {name: words for name, entry in keys.items() if (words := entry.fault(name, table))}
        self.faults += [f"[{section}] {prefix}{toml_key(name)}{words}" for name, words in faults.items()]
        good = {name: value for name, value in table.items() if name not in faults}
        values = {k: self._stored(keys[k].type, value, section, f"{prefix}{k}") for k, value in good.items()}
        return table_class(**values) if len(self.faults) == before else None

    def _stored(self, type_: ValueType, value: Any, section: str, place: str) -> Any:
        """Convert a valid value, with its tables, to the form in the dataclass."""
        if type_.item is not None:
            return tuple(self._stored(type_.item, item, section, f"{place}[{k}]") for k, item in enumerate(value))
        if type_.table is not None and isinstance(value, dict):
            return self.read(type_.table, value, section, f"{place}.")
        return type_.store(value)


def to_table(instance: Any, selected: Selected) -> dict[str, Any]:
    """Convert an instance to a table of TOML values, the inverse of `TableReader.read`.

    Keys without a value, and keys that do not belong to the case, are left out.
    """

    def to_toml(value: Any) -> Any:
        if isinstance(value, tuple):
            return [to_toml(entry) for entry in value]
        if isinstance(value, Path):
            return str(value)
        if value == math.inf:
            return INF
        return to_table(value, selected) if dataclasses.is_dataclass(value) else value

    return {
        name: to_toml(value)
        for name, entry in keys_of(type(instance)).items()
        if (value := getattr(instance, name)) is not None and all(each.holds(selected) for each in entry.only)
    }
