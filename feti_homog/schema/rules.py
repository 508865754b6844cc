"""Relations between the keys of a document, each as a JSON Schema and as the fault that is found where it fails."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from typing import Any

from feti_homog.schema.keys import Condition, Selected
from feti_homog.schema.wording import toml_value

Schema = dict[str, Any]
Path = tuple[str, ...]

ITEMS = "items"
"""In a path: the entries of a list."""
_TYPES: dict[str, Any] = {"object": dict, "array": list, "string": str, "boolean": bool}


@dataclass(frozen=True)
class Place:
    """A value of a document: its section as faults name it, its place there, itself, and what the document selects."""

    section: str
    key: str
    value: Any
    selected: Selected = field(default_factory=dict)

    def named(self, *names: str) -> str:
        """Keys of the table at this place, as the beginning of a fault."""
        above = f"{self.key}." if self.key else ""
        return f"[{self.section}] {', '.join(above + name for name in names)}"

    @property
    def given(self) -> str:
        """The value with its key, as the beginning of a fault."""
        return f"[{self.section}] {self.key} = {toml_value(self.value)}"


@dataclass(frozen=True)
class Rule:
    """Requirement at a path of a document under some conditions.

    Attributes:
        path: from the section to a table or value; where there is none, the rule holds. Empty: the whole document.
        schema: the JSON Schema of what stands there, in the words that `holds` takes.
        fault: the line for a place that is not valid.
        when: conditions all of which must hold.
    """

    path: Path
    schema: Schema | bool
    fault: Callable[[Place], str]
    when: tuple[Condition, ...] = ()

    def faults(self, document: Mapping[str, Any], selected: Selected) -> Iterator[str]:
        """Yield a line for each place of the document that is not valid."""
        if all(selected.get(condition.selector) in condition.values for condition in self.when):
            for place in _places(document, self.path):
                if not holds(self.schema, place.value):
                    yield self.fault(replace(place, selected=selected))


def exclusive(path: Path, *names: str, words: str = "exclude each other; give one", beside: Sequence[str] = ()) -> Rule:
    """At most one of these keys may be given; beside others, if there are any."""
    pairs = [{"required": [*pair, *beside]} for pair in combinations(names, 2)]

    def fault(place: Place) -> str:
        return f"{place.named(*(name for name in names if name in place.value))}: {words}"

    return Rule(path, {"not": {"type": "object", "anyOf": pairs}}, fault)


def needed(path: Path, name: str, words: str, *when: Condition, beside: str = "", unless: Sequence[str] = ()) -> Rule:
    """Return a key, or one of others in its place, must be given, under some conditions or beside another key."""
    there: Schema = {"anyOf": [{"required": [each]} for each in (name, *unless)]}
    schema = {"if": {"required": [beside]}, "then": there} if beside else there
    return Rule(path, schema, lambda place: f"{place.named(name)}: {words}", when)


def misplaced(path: Path, name: str, owner: str, words: str = "") -> Rule:
    """Return a key belongs to another one, which must be given with it."""
    line = f"belongs to {owner}, which is missing{words}"
    schema = {"if": {"required": [name]}, "then": {"required": [owner]}}
    return Rule(path, schema, lambda place: f"{place.named(name)}: {line}")


def belonging(path: Path, condition: Condition, values: Sequence[str], *when: Condition, instead: str = "") -> Rule:
    """Return a key or section, at the end of the path, belongs to cases in which a selector has some of its values."""
    others = tuple(value for value in values if value not in condition.values)

    def fault(place: Place) -> str:
        start = place.given if place.key else f"[{path[0]}]"
        owner = f"{condition.in_words(path[0])}, not {toml_value(place.selected[condition.selector])}"
        return f"{start}: belongs to {owner}{f'; use {instead}' if instead else ''}"

    return Rule(path, False, fault, (*when, condition.selector.among(*others)))


def refused(path: Path, schema: Schema, words: str, *when: Condition) -> Rule:
    """Return a value must not be valid by a schema, under some conditions."""
    return Rule(path, {"not": schema}, lambda place: f"{place.given}: {words}", when)


def holds(schema: Schema | bool, value: Any) -> bool:
    """Return whether a value is valid by a JSON Schema, of the words that are needed here."""
    if isinstance(schema, bool):
        return schema
    return all(_CHECKS[word](part, value, schema) for word, part in schema.items())


def _of(kind: Any, check: Callable[[Any, Any], bool]) -> Callable[[Any, Any, Schema], bool]:
    """Return a word that concerns values of one type."""
    return lambda part, value, _: not isinstance(value, kind) or isinstance(value, bool) or check(part, value)


_CHECKS: dict[str, Callable[[Any, Any, Schema], bool]] = {
    "type": lambda name, value, _: isinstance(value, _TYPES[name]),
    "enum": lambda choices, value, _: value in choices,
    "required": _of(dict, lambda names, table: {*names} <= table.keys()),
    "properties": _of(dict, lambda parts, table: all(holds(parts[k], v) for k, v in table.items() if k in parts)),
    "items": _of(list, lambda part, values: all(holds(part, value) for value in values)),
    "contains": _of(list, lambda part, values: any(holds(part, value) for value in values)),
    "minItems": _of(list, lambda least, values: len(values) >= least),
    "pattern": _of(str, lambda pattern, text: re.search(pattern, text) is not None),
    "minimum": _of((int, float), lambda least, number: number >= least),
    "maximum": _of((int, float), lambda most, number: number <= most),
    "exclusiveMinimum": _of((int, float), lambda low, number: number > low),
    "not": lambda part, value, _: not holds(part, value),
    "allOf": lambda parts, value, _: all(holds(part, value) for part in parts),
    "anyOf": lambda parts, value, _: any(holds(part, value) for part in parts),
    "if": lambda part, value, schema: holds(schema.get("then" if holds(part, value) else "else", True), value),
    "then": lambda *_: True,
    "else": lambda *_: True,
}


def _places(document: Mapping[str, Any], path: Path) -> Iterator[Place]:
    """Yield the values at a path; of a list of sections those of each, which are numbered from 1."""
    if not path:
        yield Place("", "", document)
        return
    given = document.get(path[0])
    sections = given if isinstance(given, list) else [given]
    for number, section in enumerate(sections, 1):
        label = path[0] if len(sections) == 1 else f"{path[0]} {number}"
        yield from _within(Place(label, "", section), path[1:])


def _within(place: Place, path: Path) -> Iterator[Place]:
    value = place.value
    if not path:
        if value is not None:
            yield place
    elif path[0] == ITEMS and isinstance(value, list):
        for k, item in enumerate(value):
            yield from _within(Place(place.section, f"{place.key}[{k}]", item), path[1:])
    elif isinstance(value, dict) and path[0] in value:
        key = f"{place.key}.{path[0]}" if place.key else path[0]
        yield from _within(Place(place.section, key, value[path[0]]), path[1:])
