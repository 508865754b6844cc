"""angle.csv and path.csv: the points of result.json, a row each."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from feti_homog.common.records import cells, plain
from feti_homog.output.files import atomic


@dataclass(frozen=True)
class Column:
    """A column of a table."""

    name: str
    unit: str
    meaning: str


def columns(kind: type) -> Iterator[Column]:
    """The columns that a record of this class fills: the reference table of its file."""
    for name, description in cells(kind).items():
        for component in description.components or (name,):
            words = f"{component}, {description.meaning}" if description.components else description.meaning
            yield Column(component, description.unit, words)


def write(path: Path, points: Sequence[Any]) -> Path:
    """Write records of one class, each in a row: numbers under their names, arrays under those of their components.

    What the first record leaves out has no column.  Call on one rank.

    Raises:
        FetiHomogError: the table cannot be written.
    """
    rows = [_row(point) for point in points]

    def write_rows(part: Path) -> None:
        with part.open("w", newline="", encoding="utf-8") as stream:
            writer = csv.DictWriter(stream, list(rows[0]) if rows else [])
            writer.writeheader()
            writer.writerows(rows)

    return atomic.replace(path, write_rows)


def _row(point: Any) -> dict[str, Any]:
    row: dict[str, Any] = {}
    values = plain(point)
    for name, described in cells(type(point)).items():
        if name in values:
            row |= dict(zip(described.components or (name,), np.ravel(values[name]).tolist(), strict=True))
    return row
