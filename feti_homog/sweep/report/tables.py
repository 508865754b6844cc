"""sweep.csv and sweep.h5: the table of a sweep and its statistics."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from feti_homog.materials.voigt import voigt_names
from feti_homog.report.text.units import unit, with_unit
from feti_homog.results import atomic
from feti_homog.sweep.report.statistics import Statistics
from feti_homog.sweep.report.sweep_table import SweepTable

PARTS = ("count", "mean", "std", "ci95")
CASE = ("folder", "point", "realisation", "status", "reason")


def write(directory: Path, table: SweepTable) -> list[Path]:
    """Write both, each in one step; returns their paths.  On one rank.  Raises FetiHomogError if it cannot."""
    writers: tuple[tuple[str, Callable[[SweepTable, Path], None]], ...] = (("sweep.csv", _csv), ("sweep.h5", _hdf5))
    return [atomic.replace(directory / name, partial(writer, table)) for name, writer in writers]


def _csv(table: SweepTable, path: Path) -> None:
    """A row for each case; then, for each point, the count, mean, std and ci95 of its realisations.

    The column `row` says which; names have their units in brackets.
    """
    names = [with_unit(name, table.stress_unit) for name in (*table.inputs, *table.outputs)]
    with path.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(["row", *CASE, *names])
        writer.writerows(_case_rows(table))
        writer.writerows(_statistics_rows(table))


def _case_rows(table: SweepTable) -> Iterator[list[Any]]:
    for row, _ in enumerate(table.folder):
        inputs = [_cell(values[row]) for values in table.inputs.values()]
        outputs = [_cell(values[row]) for values in table.outputs.values()]
        yield ["case", *(getattr(table, name)[row] for name in CASE), *inputs, *outputs]


def _statistics_rows(table: SweepTable) -> Iterator[list[Any]]:
    for number, point in enumerate(table.points):
        first = table.rows(point)[0]
        inputs = ["" if key == "cell.seed" else _cell(values[first]) for key, values in table.inputs.items()]
        for part in PARTS:
            values = [getattr(statistics, part)[number] for statistics in table.statistics.values()]
            yield [part, "", point, "", "", "", *inputs, *map(_cell, values)]


def _cell(value: Any) -> Any:
    """The value as it stands in the table: nothing for what is not there."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    return json.dumps(value) if isinstance(value, list | dict) else value


def _hdf5(table: SweepTable, path: Path) -> None:
    """/cases, /inputs, /outputs: a row a case; /statistics/mean, ...: a row a point, as /points/number and inputs.

    /curves/point-K of straight paths: strain (g,), S11, S22, ... (realisations, g) and of each mean, std, ci95 (g,).
    """
    with h5py.File(path, "w") as file:
        file.attrs.update(name=table.name, stress_unit=table.stress_unit)
        for name in CASE:
            _put(file, f"cases/{name}", list(getattr(table, name)), "")
        _put_inputs(file, table)
        for name, column in table.outputs.items():
            _put(file, f"outputs/{name}", column, unit(name, table.stress_unit))
        for name, statistics in table.statistics.items():
            for part in PARTS:
                own = "" if part == "count" else unit(name, table.stress_unit)
                _put(file, f"statistics/{part}/{name}", getattr(statistics, part), own)
        for point in table.points:
            _put_curves(file, table, point)


def _put_inputs(file: Any, table: SweepTable) -> None:
    """The inputs of all cases and, but for the seed, of all points."""
    first = [table.rows(point)[0] for point in table.points]
    _put(file, "points/number", table.points, "")
    for name, values in table.inputs.items():
        own = unit(name, table.stress_unit)
        _put(file, f"inputs/{name}", list(values), own)
        if name != "cell.seed":
            _put(file, f"points/{name}", [values[row] for row in first], own)


def _put_curves(file: Any, table: SweepTable, point: int) -> None:
    strain, stress = table.curves(point)
    if not len(strain):
        return
    group = f"curves/point-{point}"
    _put(file, f"{group}/strain", strain, "")
    for k, name in enumerate(voigt_names(stress.shape[2])[1]):
        statistics = Statistics.of(stress[:, :, k])
        _put(file, f"{group}/{name}", stress[:, :, k], table.stress_unit)
        for part in PARTS[1:]:
            _put(file, f"{group}/{name}_{part}", getattr(statistics, part), table.stress_unit)


def _put(file: Any, name: str, values: Any, own_unit: str) -> None:
    """A table of numbers if they all are, else of texts."""
    column = values if isinstance(values, np.ndarray) else _column(values)
    file[name] = column
    if own_unit:
        file[name].attrs["unit"] = own_unit


def _column(values: list[Any]) -> Any:
    if all(v is None or (isinstance(v, int | float) and not isinstance(v, bool)) for v in values):
        return np.array([np.nan if value is None else value for value in values])
    texts = [v if isinstance(v, str) else "" if v is None else json.dumps(v) for v in values]
    return np.array(texts, dtype=h5py.string_dtype())
