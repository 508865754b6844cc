"""The tables of points beside result.json say what that says; a folder without them is not the worse for it."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from feti_homog.verify.ledger import Ledger
from feti_homog.verify.prescribed import NAMES

LISTS = ("angle", "path", "load", "envelope")


def check_tables(ledger: Ledger, directory: Path, document: Mapping[str, Any]) -> None:
    """angle.csv, path.csv, load.csv and envelope.csv, each with a row a point."""
    for name in LISTS:
        path = directory / f"{name}.csv"
        if name in document and path.is_file():
            points = document[name] if isinstance(document[name], list) else [document[name]]
            _check_table(ledger, path, [dict(_columns(point)) for point in points])


def _check_table(ledger: Ledger, path: Path, points: Sequence[Mapping[str, str]]) -> None:
    with path.open(encoding="utf-8", errors="replace", newline="") as stream:
        rows = list(csv.DictReader(stream))
    columns = list(dict.fromkeys(name for point in points for name in point))
    told = [*rows[0]] if rows else columns
    ledger.record("CSV", 0.0 if len(rows) == len(points) else np.inf, f"{path.name}, the number of its rows")
    ledger.record("CSV", 0.0 if sorted(told) == sorted(columns) else np.inf, f"{path.name}, its columns")
    for number, (row, point) in enumerate(zip(rows, points, strict=False)):
        wrong = next((name for name in columns if row.get(name) != point.get(name, "")), None)
        ledger.record("CSV", 0.0 if wrong is None else np.inf, f"{path.name}, row {number}, {wrong}")


def _columns(point: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """The names of the numbers of a point, and how a table writes them."""
    for name, value in point.items():
        if name in ("strain", "stress", "thermal_stress"):
            components = NAMES[len(value)][name != "strain"]
            prefix = "thermal_" if name == "thermal_stress" else ""
            yield from zip([f"{prefix}{component}" for component in components], map(str, value), strict=True)
        elif name == "stiffness":
            yield from ((f"C{i}{j}", str(C)) for i, row in enumerate(value, 1) for j, C in enumerate(row, 1))
        elif value is None or isinstance(value, int | float | str):
            yield name, "" if value is None else str(value)
