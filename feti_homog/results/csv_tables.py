"""angle.csv and path.csv: the points of result.json, a row each."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_type_hints

import numpy as np

from feti_homog.results import atomic
from feti_homog.system.runtime.records import Description, descriptions, is_record, plain


@dataclass(frozen=True)
class Column:
    """A column of a table."""

    name: str
    unit: str
    meaning: str


def columns(kind: type) -> Iterator[Column]:
    """Yield the columns that a record of this class fills: the reference table of its file."""
    for name, description in _in_columns(kind).items():
        # Those in the plane are among those in space, in the same order.
        for component in description.spatial_components or _names(name, description):
            words = f"{component}, {description.meaning}" if description.components else description.meaning
            yield Column(component, description.unit, words)


def write(path: Path, points: Sequence[Any]) -> Path:
    """Write records of one class, each in a row: numbers under their names, arrays under those of their components.

    What no record has, arrays without components and records in records have no column.  Call on one rank.

    Raises:
        FetiHomogError: the table cannot be written.
    """
    described = _in_columns(type(points[0])) if points else {}
    rows = [_row(point, described) for point in points]
    there = {name for row in rows for name in row}
    names = [column.name for column in columns(type(points[0])) if column.name in there] if rows else []

    def write_rows(part: Path) -> None:
        with part.open("w", newline="", encoding="utf-8") as stream:
            writer = csv.DictWriter(stream, names)
            writer.writeheader()
            writer.writerows(rows)

    return atomic.replace(path, write_rows)


def _names(name: str, description: Description) -> tuple[str, ...]:
    """Return the columns of a field, of an array those of its components in the plane."""
    return description.components or (name,)


def _row(point: Any, described: Mapping[str, Description]) -> dict[str, Any]:
    row: dict[str, Any] = {}
    for name, value in plain(point).items():
        if name in described:
            values, components = np.ravel(value).tolist(), _names(name, described[name])
            if len(values) > len(components):
                components = described[name].spatial_components
            row |= dict(zip(components, values, strict=True))
    return row


def _in_columns(kind: type) -> dict[str, Description]:
    """Return the fields of a record that fill columns: numbers, and arrays whose components have names."""
    hints = get_type_hints(kind)
    found = {name: d for name, d in descriptions(kind).items() if d.components or not d.shape}
    return {name: d for name, d in found.items() if not is_record(hints[name])}
