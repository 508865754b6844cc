"""Reading a table of a case file into a frozen dataclass whose fields say what they accept."""

from __future__ import annotations

import dataclasses
import difflib
import json
import math
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
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


def are_reals(value: object, count: int | None = None) -> bool:
    """Whether the value is a list of numbers, so many if a count is given."""
    return isinstance(value, list) and count in (None, len(value)) and all(map(is_real, value))


def as_reals(value: Iterable[Any]) -> tuple[float, ...]:
    return tuple(map(float, value))


def choice(*options: str) -> Kind:
    return Kind("one of " + ", ".join(map(shown, options)), lambda value: value in options, str)


def accepted(cls: type[Any], table: object, name: str) -> Any:
    """The value of a key if it is right, its default if it is not there, None if it is faulty."""
    default = getattr(cls, name, None)
    value = table.get(name, default) if isinstance(table, dict) else default
    return value if keys_of(cls)[name].kind.accepts(value) else None


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
        return f"it belongs to {owners[name]}"
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
    chosen: str | None = None,
    owners: Mapping[str, str] = NOWHERE,
    prefix: str = "",
) -> T | None:
    """The table as an instance of `cls`; None, and one line per fault added to `faults`, if it is faulty.

    `variant` names the key whose value `chosen` (None if that is faulty) decides which others belong; `owners`
    says where keys belong that belong elsewhere; `prefix` stands before the keys of a table within a section.
    """
    if not isinstance(table, dict):
        faults.append(f"{section} = {shown(table)}: expected a section [{section}]")
        return None
    keys = keys_of(cls)
    found = {
        name: f" = {shown(value)}: unknown key; {suggestion(name, keys, owners)}"
        for name, value in table.items()
        if name not in keys
    }
    found |= {name: _fault(name, entry, table, variant, chosen) for name, entry in keys.items()}
    lines = [f"[{section}] {prefix}{named(name)}{words}" for name, words in found.items() if words]
    faults += lines
    return None if lines else cls(**{name: keys[name].kind.store(value) for name, value in table.items()})


def written(instance: Any, chosen: str = "") -> dict[str, Any]:
    """The table, of TOML's values, that `read` makes the instance of; without the keys of other variants."""
    return {
        name: _plain(getattr(instance, name), chosen)
        for name, entry in keys_of(type(instance)).items()
        if getattr(instance, name) is not None and (not entry.only or chosen in entry.only)
    }


def _plain(value: Any, chosen: str) -> Any:
    """The value as TOML has it."""
    if isinstance(value, tuple):
        return [_plain(entry, chosen) for entry in value]
    if isinstance(value, Path):
        return str(value)
    return written(value, chosen) if dataclasses.is_dataclass(value) else value
