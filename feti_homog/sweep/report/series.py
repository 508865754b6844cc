"""Series of a sweep's table: points that differ by one key only, to be drawn as one line."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from feti_homog.sweep.report.sweep_table import SweepTable
from feti_homog.typing import Float


@dataclass(frozen=True)
class Series:
    """Points that differ by one key only: their numbers, and that key's values `x`, rising."""

    label: str
    points: list[int]
    x: Float


def series_over(table: SweepTable, key: str) -> list[Series]:
    """The series over a key, of the points with finished cases.

    What varies along with the key, one value to one, makes no other series.
    """
    points = [p for p in table.points if table.results_of(p) and table.input_of(p, key) is not None]
    along = [name for name in table.inputs if _follows(table, points, name, key)]
    labels = {point: table.label(point, along) for point in points}
    return [
        _series(table, key, label, [point for point in points if labels[point] == label])
        for label in dict.fromkeys(labels.values())
    ]


def _series(table: SweepTable, key: str, label: str, points: Sequence[int]) -> Series:
    pairs = sorted((float(table.input_of(point, key)), point) for point in points)
    return Series(label, [point for _, point in pairs], np.array([x for x, _ in pairs]))


def _follows(table: SweepTable, points: Sequence[int], name: str, key: str) -> bool:
    """Whether an input has one value for each value of the key."""
    pairs = {(repr(table.input_of(point, key)), repr(table.input_of(point, name))) for point in points}
    return len(pairs) == len({value for value, _ in pairs})


def varies(table: SweepTable, key: str) -> bool:
    """Whether a key has more than one value among finished cases."""
    values = table.inputs.get(key, ())
    return len({v for v, d in zip(values, table.documents, strict=False) if v is not None and d is not None}) > 1
