"""angle.csv and path.csv: the points of result.json, a row each."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_type_hints

import numpy as np

from feti_homog.common.records import Description, descriptions, is_record, plain
from feti_homog.output.files import atomic


@dataclass(frozen=True)
class Column:
    """A column of a table."""

    name: str
    unit: str
    meaning: str


def columns(kind: type) -> Iterator[Column]:
    """The columns that a record of this class fills: the reference table of its file."""
    for name, description in _in_columns(kind).items():
        if not description.components:
            yield Column(name, description.unit, description.meaning)
        for component in dict.fromkeys((*description.components, *description.spatial)):
            yield Column(component, description.unit, f"{component}, {description.meaning}")


def write(path: Path, points: Sequence[Any]) -> Path:
    """Write records of one class, each in a row: numbers under their names, arrays under those of their components.

    What no record has, arrays without components and records in records have no column.  Call on one rank.

    Raises:
        FetiHomogError: the table cannot be written.
    """
    described = _in_columns(type(points[0])) if points else {}
    rows = [_row(point, described) for point in points]
    filled = (next((row[name] for row in rows if name in row), {}) for name in described)
    names = [column for cells in filled for column in cells]

    def write_rows(part: Path) -> None:
        with part.open("w", newline="", encoding="utf-8") as stream:
            writer = csv.DictWriter(stream, names)
            writer.writeheader()
            writer.writerows(
                {column: value for cells in row.values() for column, value in cells.items()} for row in rows
            )

    return atomic.replace(path, write_rows)


def _row(point: Any, described: Mapping[str, Description]) -> dict[str, dict[str, Any]]:
    """The cells of each field of a record by their columns."""
    values = ((name, np.ravel(value).tolist()) for name, value in plain(point).items() if name in described)
    return {name: dict(zip(_names(name, described[name], len(row)), row, strict=True)) for name, row in values}


def _names(name: str, description: Description, size: int) -> tuple[str, ...]:
    """The columns of a field with so many numbers."""
    if size == len(description.spatial):
        return description.spatial
    return description.components or (name,)


def _in_columns(kind: type) -> dict[str, Description]:
    """The fields of a record that fill columns: numbers, and arrays whose components have names."""
    hints = get_type_hints(kind)
    found = {name: d for name, d in descriptions(kind).items() if d.components or not d.shape}
    return {name: d for name, d in found.items() if not is_record(hints[name])}
