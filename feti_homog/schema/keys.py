"""Reading a table of a case file into a frozen dataclass whose fields carry their rules and their meaning."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from feti_homog.schema.values import INF, ValueType
from feti_homog.schema.wording import suggestion, toml_key, toml_value

T = TypeVar("T")


@dataclass(frozen=True)
class Selector:
    """The key of a section whose value decides which other keys belong to the case.

    `word` is the key that messages name, if it has several names.
    """

    section: str
    key: str
    word: str = ""

    def among(self, *values: str) -> Condition:
        """Return the condition that the key has one of these values."""
        return Condition(self, values)

    def in_words(self, section: str) -> str:
        """Return the key as a fault in a section names it."""
        word = self.word or self.key
        return word if section == self.section else f"[{self.section}] {word}"


@dataclass(frozen=True)
class Condition:
    """Condition that a selector has one of some values."""

    selector: Selector
    values: tuple[str, ...]

    def in_words(self, section: str) -> str:
        """Return the condition as it is read in a section."""
        return f"{self.selector.in_words(section)} = {' or '.join(map(toml_value, self.values))}"


Selected = Mapping[Selector, str | None]
"""The value of each selector, None if that is faulty: then what depends on it is not checked."""


@dataclass(frozen=True)
class Key:
    """A key of a table.

    Attributes:
        type: what its value must be.
        meaning: a sentence or two for the reference.
        unit: of the value, empty if it has none.
        default: in words; empty if there is none.
        only: when it belongs to the table: all of these conditions hold.
        required: whether it must be there where it belongs.
        instead: what to write where it does not belong; empty if there is nothing like it.
        unless: other keys of the table, beside any of which it is not required.
        by_pair: whether it may differ between several sections [[interface]].
        presentation: whether it decides how results are drawn and labelled, and nothing of their numbers.
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

    def belongs(self, selected: Selected) -> bool:
        """Return whether the key belongs to the table; not, if that depends on a faulty selector."""
        return all(selected.get(condition.selector) in condition.values for condition in self.only)


def key(
    type_: ValueType,
    meaning: str,
    *,
    unit: str = "",
    default: Any = dataclasses.MISSING,
    default_words: str = "",
    only: Condition | tuple[Condition, ...] = (),
    instead: str = "",
    unless: tuple[str, ...] = (),
    by_pair: bool = False,
    presentation: bool = False,
) -> Any:
    """Return a dataclass field read from the key of its name; required where it belongs if it has no default.

    `default_words` stand for a default of None.
    """
    conditions = only if isinstance(only, tuple) else (only,)
    required = default is dataclasses.MISSING
    written = toml_value(list(default) if isinstance(default, tuple) else default)
    words = default_words or ("" if required or default is None else written)
    metadata = {"key": Key(type_, meaning, unit, words, conditions, required, instead, unless, by_pair, presentation)}
    if required and not conditions:
        return dataclasses.field(metadata=metadata)
    return dataclasses.field(default=None if required else default, metadata=metadata)


def keys_of(table_class: type[Any]) -> dict[str, Key]:
    """Return the keys of a table by name; fields that are made of them are none."""
    return {each.name: each.metadata["key"] for each in dataclasses.fields(table_class) if "key" in each.metadata}


def selected_value(table_class: type[Any], table: object, name: str) -> Any:
    """Return the value of a key if it is right, its default if it is not there, None if it is faulty."""
    default = getattr(table_class, name, None)
    value = table.get(name, default) if isinstance(table, Mapping) else default
    return value if keys_of(table_class)[name].type.accepts(value) else None


@dataclass
class TableReader:
    """Reads tables and gathers what is wrong with them.

    Attributes:
        selected: the values that decide which keys belong to the case.
        owners: where keys belong that are unknown in a table.
        faults: one line each.
    """

    selected: Selected = field(default_factory=dict)
    owners: Mapping[str, str] = field(default_factory=dict)
    faults: list[str] = field(default_factory=list)

    def read(self, table_class: type[T], table: object, section: str, prefix: str = "") -> T | None:
        """Return the table as an instance of `table_class`; None, and a line for each fault, if it is faulty.

        `prefix` stands before the keys of a table within a section.
        """
        if not isinstance(table, dict):
            self.faults.append(f"{section} = {toml_value(table)}: expected a section [{section}]")
            return None
        keys, before = keys_of(table_class), len(self.faults)
        unknown = {
            name: f" = {toml_value(value)}: unknown key; {suggestion(name, keys, self.owners)}"
            for name, value in table.items()
            if name not in keys
        }
        known = {name: self._fault(name, entry, table) for name, entry in keys.items()}
        faulty = {name: words for name, words in (unknown | known).items() if words}
        self.faults += [f"[{section}] {prefix}{toml_key(name)}{words}" for name, words in faulty.items()]
        values = {
            name: self._stored(keys[name].type, value, section, f"{prefix}{name}")
            for name, value in table.items()
            if name in keys and keys[name].type.accepts(value)
        }
        return table_class(**values) if len(self.faults) == before else None

    def _stored(self, type_: ValueType, value: Any, section: str, place: str) -> Any:
        """Return a right value as its dataclass keeps it, with the tables in it read."""
        if type_.item is not None:
            return tuple(self._stored(type_.item, item, section, f"{place}[{k}]") for k, item in enumerate(value))
        if type_.table is not None and isinstance(value, dict):
            return self.read(type_.table, value, section, f"{place}.")
        return type_.store(value)

    def _fault(self, name: str, entry: Key, table: Mapping[str, Any]) -> str:
        """Return the fault of one known key, whatever the case, empty if there is none."""
        if name not in table:
            return f": missing; expected {entry.type.expected}" if entry.required and not entry.only else ""
        complaint = entry.type.complaint(table[name])
        return f" = {toml_value(table[name])}: {complaint}" if complaint else ""


def to_table(instance: Any, selected: Selected) -> dict[str, Any]:
    """Return the table, of TOML's values, that `TableReader.read` makes the instance of.

    It has neither the keys that do not belong to the case nor those without a value.
    """
    return {
        name: _to_toml(getattr(instance, name), selected)
        for name, entry in keys_of(type(instance)).items()
        if getattr(instance, name) is not None and entry.belongs(selected)
    }


def _to_toml(value: Any, selected: Selected) -> Any:
    """Return the value as TOML has it."""
    if isinstance(value, tuple):
        return [_to_toml(entry, selected) for entry in value]
    if isinstance(value, Path):
        return str(value)
    if value == math.inf:
        return INF
    return to_table(value, selected) if dataclasses.is_dataclass(value) else value
