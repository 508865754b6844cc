"""Relations between the keys of a document: a test of each place, and the fault of a place that fails it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from feti_homog.schema.keys import Condition, Selected
from feti_homog.schema.wording import toml_value

Path = tuple[str, ...]
Test = Callable[[Any], bool]

ITEMS = "items"
"""In a path: the entries of a list."""


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
        holds: whether the value there is valid; None if no value may stand there.
        fault: the line for a place that is not valid.
        when: conditions all of which must hold.
    """

    path: Path
    holds: Test | None
    fault: Callable[[Place], str]
    when: tuple[Condition, ...] = ()

    def faults(self, document: Mapping[str, Any], selected: Selected) -> Iterator[str]:
        """Yield a line for each place of the document that is not valid."""
        if all(selected.get(condition.selector) in condition.values for condition in self.when):
            for place in _places(document, self.path):
                if self.holds is None or not self.holds(place.value):
                    yield self.fault(replace(place, selected=selected))


def has(table: Any, *names: str) -> bool:
    """Return whether the value is a table with all of these keys."""
    return isinstance(table, dict) and {*names} <= table.keys()


def exclusive(path: Path, *names: str, words: str = "exclude each other; give one", beside: Sequence[str] = ()) -> Rule:
    """Allow at most one of these keys; beside others, if there are any."""

    def fault(place: Place) -> str:
        return f"{place.named(*(name for name in names if name in place.value))}: {words}"

    return Rule(path, lambda table: not has(table, *beside) or sum(has(table, name) for name in names) < 2, fault)


def needed(path: Path, name: str, words: str, *when: Condition, beside: str = "", unless: Sequence[str] = ()) -> Rule:
    """Require a key, or one of others in its place, under some conditions or beside another key."""

    def holds(table: Any) -> bool:
        is_asked = isinstance(table, dict) and (not beside or beside in table)
        return not is_asked or any(each in table for each in (name, *unless))

    return Rule(path, holds, lambda place: f"{place.named(name)}: {words}", when)


def misplaced(path: Path, name: str, owner: str, words: str = "") -> Rule:
    """Require `owner` wherever `name` is given."""
    line = f"belongs to {owner}, which is missing{words}"
    return Rule(
        path, lambda table: not has(table, name) or owner in table, lambda place: f"{place.named(name)}: {line}"
    )


def belonging(path: Path, condition: Condition, values: Sequence[str], *when: Condition, instead: str = "") -> Rule:
    """Refuse the key or section at the end of the path where the selector has other values than the condition."""
    others = tuple(value for value in values if value not in condition.values)

    def fault(place: Place) -> str:
        start = place.given if place.key else f"[{path[0]}]"
        owner = f"{condition.in_words(path[0])}, not {toml_value(place.selected[condition.selector])}"
        return f"{start}: belongs to {owner}{f'; use {instead}' if instead else ''}"

    return Rule(path, None, fault, (*when, condition.selector.among(*others)))


def refused(path: Path, is_refused: Test, words: str, *when: Condition) -> Rule:
    """Refuse values by a test, under some conditions."""
    return Rule(path, lambda value: not is_refused(value), lambda place: f"{place.given}: {words}", when)


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
