"""angle.csv and path.csv: the points of result.json, a row each."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from feti_homog.output.files import atomic

STRAIN, STRESS = ("E11", "E22", "G12"), ("S11", "S22", "S12")
STIFFNESS = tuple(f"C{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3))
COLUMNS = {"strain": STRAIN, "stress": STRESS, "stiffness": STIFFNESS}


def write(directory: Path, document: Mapping[str, Any]) -> list[Path]:
    """Write a table for each list of points in the document.  Call on one rank.

    Raises:
        FetiHomogError: a table cannot be written.
    """
    paths = []
    for name in ("angle", "path"):
        if name in document:
            paths.append(Path(directory) / f"{name}.csv")
            _write(paths[-1], [_row(point) for point in document[name]])
    return paths


def _row(point: Mapping[str, Any]) -> dict[str, Any]:
    row: dict[str, Any] = {}
    for key, value in point.items():
        if key in COLUMNS:
            row |= dict(zip(COLUMNS[key], np.ravel(value).tolist(), strict=True))
        else:
            row[key] = value
    return row


def _write(path: Path, rows: list[dict[str, Any]]) -> None:
    def write_rows(part: Path) -> None:
        with part.open("w", newline="", encoding="utf-8") as stream:
            writer = csv.DictWriter(stream, list(rows[0]) if rows else [])
            writer.writeheader()
            writer.writerows(rows)

    atomic.replace(path, write_rows)
