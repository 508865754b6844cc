"""Reading case file tables into frozen dataclasses whose fields carry their rules."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from feti_homog.schema.types import INF, ValueType
from feti_homog.schema.wording import suggestion, toml_key, toml_value

T = TypeVar("T")


@dataclass(frozen=True)
class Selector:
    """A section's key whose value decides which other keys belong to the case.

    `word` is the key that messages name, if it has several names.
    """

    section: str
    key: str
    word: str = ""

    def among(self, *values: str) -> Condition:
        """Return the condition that the key has one of these values."""
        return Condition(self, values)


@dataclass(frozen=True)
class Condition:
    """Condition that a selector has one of some values."""

    selector: Selector
    values: tuple[str, ...]

    def holds(self, selected: Selected) -> bool:
        """Return whether the condition holds; not, if the selector is faulty."""
        return selected.get(self.selector) in self.values

    def in_words(self, section: str) -> str:
        """Return the condition as a fault in a section names it."""
        word = self.selector.word or self.selector.key
        name = word if section == self.selector.section else f"[{self.selector.section}] {word}"
        return f"{name} = {' or '.join(map(toml_value, self.values))}"


Selected = Mapping[Selector, str | None]
"""The value of each selector, None if it is faulty: then nothing that depends on it is checked."""


@dataclass(frozen=True)
class Key:
    """A key of a table.

    Attributes:
        type: its value's type.
        meaning: a sentence or two for the reference.
        unit: unit symbol, empty if it has none.
        default: in words; empty if there is none.
        only: conditions under all of which it belongs to the table.
        required: whether it must be there where it belongs.
        instead: replacement where it does not belong; empty if there is none.
        unless: other keys of the table; beside any of them it is not required.
        by_pair: whether it may differ between several sections [[interface]].
        presentation: whether it decides how results are drawn and labelled, and changes no number.
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
        """Return the fault of the key with this name in a table, whatever the case; empty if there is none."""
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
    """Return a dataclass field read from the key with its name; required where it belongs if it has no default.

    Without the key its value is None if `absent` says the meaning; `default_words` stand for another default, and
    `attributes` are further `Key` attributes.
    """
    conditions = only if isinstance(only, tuple) else (only,)
    default = None if absent else default
    required = default is dataclasses.MISSING
    written = toml_value(list(default) if isinstance(default, tuple) else default)
    words = absent or default_words or ("" if required or default is None else written)
    entry = Key(type_, meaning, default=words, only=conditions, required=required, **attributes)
    if required and not conditions:
        return dataclasses.field(metadata={"key": entry})
    return dataclasses.field(default=None if required else default, metadata={"key": entry})


def keys_of(table_class: type[Any]) -> dict[str, Key]:
    """Return a table's keys by name; derived fields are none."""
    return {each.name: each.metadata["key"] for each in dataclasses.fields(table_class) if "key" in each.metadata}


@dataclass
class TableReader:
    """Reads tables and gathers their faults.

    Attributes:
        selected: the values that decide which keys belong to the case.
        owners: where keys belong that are unknown in a table.
        faults: one line each.
    """

    selected: Selected = field(default_factory=dict)
    owners: Mapping[str, str] = field(default_factory=dict)
    faults: list[str] = field(default_factory=list)

    def read(self, table_class: type[T], table: object, section: str, prefix: str = "") -> T | None:
        """Return the table as a `table_class` instance; None, and a line for each fault, if it is faulty.

        `prefix` stands before a table's keys within a section.
        """
        if not isinstance(table, dict):
            self.faults.append(f"{section} = {toml_value(table)}: expected a section [{section}]")
            return None
        keys, before = keys_of(table_class), len(self.faults)
        faults = {
            name: f" = {toml_value(table[name])}: unknown key; {suggestion(name, keys, self.owners)}"
            for name in table
            if name not in keys
        }
        faults |= {name: words for name, entry in keys.items() if (words := entry.fault(name, table))}
        self.faults += [f"[{section}] {prefix}{toml_key(name)}{words}" for name, words in faults.items()]
        good = {name: value for name, value in table.items() if name not in faults}
        values = {k: self._stored(keys[k].type, value, section, f"{prefix}{k}") for k, value in good.items()}
        return table_class(**values) if len(self.faults) == before else None

    def _stored(self, type_: ValueType, value: Any, section: str, place: str) -> Any:
        """Return a valid value as its dataclass keeps it, with its tables read."""
        if type_.item is not None:
            return tuple(self._stored(type_.item, item, section, f"{place}[{k}]") for k, item in enumerate(value))
        if type_.table is not None and isinstance(value, dict):
            return self.read(type_.table, value, section, f"{place}.")
        return type_.store(value)


def to_table(instance: Any, selected: Selected) -> dict[str, Any]:
    """Return the table, of TOML's values, that `TableReader.read` makes the instance of.

    It has neither the keys that do not belong to the case nor keys without a value.
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
