"""Reference tables of result.json and result.h5, from the records that their writers use."""

import dataclasses
import typing
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

from feti_homog.analysis.result import Result
from feti_homog.results.field_layout import (
    GROUP_OF_STATES,
    PROGRAM,
    SPATIAL_VIEWS,
    VIEWS,
    FibrePart,
    Header,
    InterfacePart,
    MeshPart,
    SpatialStatePart,
    StatePart,
    View,
    rows_of,
)  # fmt: skip
from feti_homog.system.runtime.records import Description, descriptions, without_none

WORDS = {float: "number", int: "integer", str: "text", bool: "true or false"}
GROUPS = {"mesh": MeshPart, "fibre": FibrePart, "interface": InterfacePart, GROUP_OF_STATES: StatePart}


@dataclass(frozen=True)
class ResultKey:
    """A key of a document; `path` is its place, such as `cell.width`, `path[].strain`, `timings.STAGE`."""

    path: str
    type: str
    unit: str
    meaning: str


@dataclass(frozen=True)
class Item:
    """A dataset or an attribute of result.h5; K in `path` is the number of a state, from 0."""

    path: str
    kind: str
    shape: str
    dtype: str
    unit: str
    meaning: str


def schema_keys() -> Iterator[ResultKey]:
    """Yield result.json keys with type, unit and meaning."""
    return _keys(Result)


def items() -> Iterator[Item]:
    """Yield all datasets and attributes of result.h5 in plane strain and stress."""
    yield from _items_of(Header, "", ())
    yield Item("/", "attribute created_by", "", "text", "", f"`{PROGRAM}`")
    for group, part in GROUPS.items():
        yield from _items_of(part, group, VIEWS.get(group, ()))


def spatial_items() -> Iterator[Item]:
    """Yield the items of result.h5 in generalized plane strain that differ from `items`."""
    plane = set(items())
    yield from (item for item in _items_of(SpatialStatePart, GROUP_OF_STATES, SPATIAL_VIEWS) if item not in plane)


def _keys(kind: type, above: str = "") -> Iterator[ResultKey]:
    """Yield the keys of a record and of the records that it contains."""
    hints = typing.get_type_hints(kind)
    for name, description in descriptions(kind).items():
        path, hint = f"{above}{name}", without_none(hints[name])
        yield ResultKey(path, _type_words(hint, description), description.unit, description.meaning)
        for key, meaning in description.entries.items():
            item = typing.get_args(hint)[1]
            yield ResultKey(f"{path}.{key}", WORDS.get(item, "any"), description.unit, meaning)
        if dataclasses.is_dataclass(hint):
            yield from _keys(typing.cast(type, hint), f"{path}.")
        elif (record := _record_of_tuple(hint)) is not None:
            yield from _keys(record, f"{path}[].")


def _items_of(part: type, group: str, views: Iterable[View]) -> Iterator[Item]:
    """Yield the items of a group, then its virtual datasets."""
    hints = typing.get_type_hints(part)
    for name, d in descriptions(part).items():
        if rows_of(d):
            yield Item(f"/{group}/{name}", "dataset", d.shape, d.dtype, d.unit, d.meaning)
        else:
            type_name = _type_words(hints[name], d)
            yield Item(f"/{group}", f"attribute {d.name or name}", d.shape, type_name, d.unit, d.meaning)
    for view in views:
        d = descriptions(part)[view.source]
        shape = f"({rows_of(d)}, {view.components})" if view.components else f"({rows_of(d)},)"
        yield Item(f"/{view.path(group)}", "dataset", shape, d.dtype, d.unit, f"{view.meaning}; virtual")


def _type_words(hint: Any, description: Description) -> str:
    """Return the type of a field in words."""
    if description.shape:
        return f"numbers {description.shape}"
    if dataclasses.is_dataclass(hint) or typing.get_origin(hint) not in (None, tuple):
        return "table"
    if _record_of_tuple(hint) is not None:
        return "list of tables"
    if typing.get_origin(hint) is tuple:
        return f"list of {WORDS[typing.get_args(hint)[0]]}s"
    return WORDS.get(hint, "any")


def _record_of_tuple(hint: Any) -> type | None:
    """Return the class `Record` for `tuple[Record, ...]`, None for other hints."""
    item = typing.get_args(hint)[0] if typing.get_origin(hint) is tuple else None
    return item if dataclasses.is_dataclass(item) and isinstance(item, type) else None
