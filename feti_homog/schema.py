"""Reading a table of a case file into a frozen dataclass whose fields say what they accept."""

from __future__ import annotations

import dataclasses
import difflib
import json
import math
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, TypeVar

T = TypeVar("T")
MAGNITUDES = (1e-100, 1e100)  # of numbers other than 0: no product of a few over- or underflows


@dataclass(frozen=True)
class Kind:
    """What a value must be, in words and as a test, and how it is then stored."""

    expected: str
    accepts: Callable[[Any], bool]
    store: Callable[[Any], Any]


@dataclass(frozen=True)
class Key:
    """A key of a table: the variants it belongs to (all, if empty) and whether it must be there."""

    kind: Kind
    only: tuple[str, ...]
    required: bool


def key(kind: Kind, *, default: Any = dataclasses.MISSING, only: tuple[str, ...] = ()) -> Any:
    """A dataclass field read from the key of its name; required where it belongs if it has no default."""
    required = default is dataclasses.MISSING
    metadata = {"key": Key(kind, only, required)}
    if required and not only:
        return dataclasses.field(metadata=metadata)
    return dataclasses.field(default=None if required else default, metadata=metadata)


def keys_of(cls: type[Any]) -> dict[str, Key]:
    return {field.name: field.metadata["key"] for field in dataclasses.fields(cls)}


# Kinds of values


def is_real(value: object) -> bool:
    """Whether the value is a finite number of sensible magnitude (true and false are none)."""
    least, most = MAGNITUDES
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return value == 0 or least <= abs(value) <= most


def _numeric(noun: str, is_number: Callable[[Any], bool], store: Callable[[Any], Any]) -> Callable[..., Kind]:
    def kind(
        *, above: float = -math.inf, least: float = -math.inf, below: float = math.inf, most: float = math.inf
    ) -> Kind:
        limits = {"above": above, "at least": least, "below": below, "at most": most}
        words = [f"{word} {limit:.6g}" for word, limit in limits.items() if math.isfinite(limit)]
        return Kind(
            f"{noun} {' and '.join(words)}".strip(),
            lambda value: is_number(value) and above < value < below and least <= value <= most,
            store,
        )

    return kind


real = _numeric("a number", is_real, float)
integer = _numeric("an integer", lambda value: is_real(value) and isinstance(value, int), int)
boolean = Kind("true or false", lambda value: isinstance(value, bool), bool)
text = Kind("a text in one line", lambda value: isinstance(value, str) and value.isprintable(), str)


def choice(*options: str) -> Kind:
    return Kind("one of " + ", ".join(map(shown, options)), lambda value: value in options, str)


def accepted(cls: type[Any], table: object, name: str) -> Any:
    """The value of a key if it is there and right, else None."""
    value = table.get(name) if isinstance(table, dict) else None
    return value if name and keys_of(cls)[name].kind.accepts(value) else None


# Words of the faults

NOWHERE: Mapping[str, str] = MappingProxyType({})


def shown(value: object) -> str:
    """The value nearly as TOML writes it, in one short line."""
    if isinstance(value, float):
        return repr(value)
    written = json.dumps(value, default=str, ensure_ascii=not str(value).isprintable())
    return written if len(written) <= 60 else written[:57] + "..."


def named(name: str) -> str:
    """A key as TOML writes it: quoted if it is not bare."""
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else shown(name)


def suggestion(name: str, known: Iterable[str], owners: Mapping[str, str] = NOWHERE) -> str:
    """The end of a fault on an unknown name: where it belongs, the nearest known name, or all of them."""
    known = list(known)
    nearest = difflib.get_close_matches(name, known, n=1)
    if name in owners:
        return f"it belongs to [{owners[name]}]"
    if nearest:
        return f"did you mean {named(nearest[0])}?"
    return "known here: " + ", ".join(map(named, known))


def _fault(name: str, entry: Key, table: Mapping[str, Any], variant: str, chosen: str | None) -> str:
    """What is wrong with one known key, empty if nothing; `chosen` is the variant, None if that is faulty."""
    belongs = not entry.only or chosen in entry.only
    if name not in table:
        return f": missing; expected {entry.kind.expected}" if entry.required and belongs else ""
    written = f" = {shown(table[name])}: "
    if not belongs and chosen is not None:
        homes = " or ".join(map(shown, entry.only))
        return f"{written}belongs to {variant} = {homes}, not {shown(chosen)}"
    return "" if entry.kind.accepts(table[name]) else f"{written}expected {entry.kind.expected}"


def read(
    cls: type[T],
    table: object,
    section: str,
    faults: list[str],
    variant: str = "",
    owners: Mapping[str, str] = NOWHERE,
) -> T | None:
    """The table as an instance of `cls`; None, and one line per fault added to `faults`, if it is faulty.

    `variant` names the key whose value decides which others belong; `owners` gives the sections of keys that
    belong elsewhere.
    """
    if not isinstance(table, dict):
        faults.append(f"{section} = {shown(table)}: expected a section [{section}]")
        return None
    keys = keys_of(cls)
    chosen = accepted(cls, table, variant)
    found = {
        name: f" = {shown(value)}: unknown key; {suggestion(name, keys, owners)}"
        for name, value in table.items()
        if name not in keys
    }
    found |= {name: _fault(name, entry, table, variant, chosen) for name, entry in keys.items()}
    lines = [f"[{section}] {named(name)}{words}" for name, words in found.items() if words]
    faults += lines
    return None if lines else cls(**{name: keys[name].kind.store(value) for name, value in table.items()})


def written(instance: Any, chosen: str = "") -> dict[str, Any]:
    """The table that `read` makes the instance of, without the keys that are absent or of other variants."""
    return {
        name: getattr(instance, name)
        for name, entry in keys_of(type(instance)).items()
        if getattr(instance, name) is not None and (not entry.only or chosen in entry.only)
    }
