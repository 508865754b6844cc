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

from feti_homog.materials.bounds import Moduli
from feti_homog.materials.spatial_constants import EngineeringConstants, TransverselyIsotropic
from feti_homog.materials.voigt import voigt_names
from feti_homog.report.text.table import unit, with_unit
from feti_homog.results import atomic
from feti_homog.results.csv_tables import Column, columns
from feti_homog.runtime.records import STRESS
from feti_homog.sweep.report.sweep_table import Statistics, SweepTable

CASE_COLUMNS = (
    Column("row", "", "`case`, or of a point the `count`, `mean`, `std` and `ci95` of its realisations"),
    Column("folder", "", "folder of the case, below the folder of the sweep"),
    Column("point", "", "number of the point, from 1"),
    Column("realisation", "", "number of the realisation of the point, from 1"),
    Column("status", "", "`done`, `not converged`, `failed`, `damaged`, `running` or `waiting`"),
    Column("reason", "", "why there is no result"),
)
INPUT_COLUMNS = (Column("SECTION.KEY", "that of the key", "value of a key that varies"),)
MODULI = {column.name for column in columns(Moduli)}
OUTPUT_COLUMNS = (
    Column("fraction_meshed", "", "share of all fibres in the meshed area"),
    Column("fraction_PHASE", "", "share of a phase in the meshed area, if there are more than matrix and fibre"),
    Column("porosity", "", "share of voids in the area of the cell, where there are some"),
    Column("match_distance", "", "of cells with `match`: how far they are from the table, in mean diameters"),
    Column("elements", "", "triangles of the refined mesh"),
    Column("nodes", "", "nodes of the refined mesh, those on cuts once for each subdomain"),
    Column("ranks", "", "MPI ranks"),
    Column("subdomains", "", "subdomains that the bodies are cut into"),
    Column("dofs", "", "degrees of freedom of all subdomains"),
    Column("multipliers", "", "Lagrange multipliers of the dual problem"),
    Column("iterations", "", "Krylov iterations of all states"),
    Column("Cij", STRESS, "entry of L^ef; beside generalized plane strain C66 is the shear modulus of all"),
    Column("Cij_compression", STRESS, "the same under minus the unit strains, with contact"),
    Column("thermal_Sij", f"{STRESS} per unit of temperature", "stress per unit of temperature at no strain"),
    Column("expansion_STRAIN", "1 / temperature", "strain per unit of temperature at no stress"),
    Column("anisotropy_axial", STRESS, "C11 - C22"),
    Column("anisotropy_shear", STRESS, "C33 - (C11 + C22 - 2 C12) / 4; with generalized plane strain C66 - ..."),
    *columns(Moduli),
    *(column for column in columns(EngineeringConstants) if column.name not in MODULI),
    *columns(TransverselyIsotropic),
    Column("Cii_reuss", STRESS, "lower bound of Cii"),
    Column("Cii_voigt", STRESS, "upper bound of Cii"),
    Column("bulk_lower", STRESS, "lower bound of bulk, by Hashin and Shtrikman"),
    Column("bulk_upper", STRESS, "upper bound of bulk, by Hashin and Shtrikman"),
    Column("shear_lower", STRESS, "lower bound of shear, by Hashin and Shtrikman"),
    Column("shear_upper", STRESS, "upper bound of shear, by Hashin and Shtrikman"),
    Column("angle_ANGLE_Cij", STRESS, "entry of L^ef at an opening of that many degrees"),
    Column("angle_ANGLE_Sij", STRESS, "macroscopic stress at an opening of that many degrees"),
    Column("onset_load_factor", "", "load factor of the first point of a path"),
    Column("dissipated", STRESS, "energy lost to all breaks of a path, per area of the cell"),
    Column("work", STRESS, "work of the loads along a path, per area of the cell"),
    Column("onset_Sij", STRESS, "macroscopic stress at the first point of a path"),
    Column("onset_STRAIN", "", "macroscopic strain at the first point of a path"),
    Column("peak_Sij", STRESS, "largest in magnitude of a path, with its sign"),
    Column("peak_STRAIN", "", "strain at the peak of the stress of the component whose strain leads"),
    Column("end_Sij", STRESS, "macroscopic stress at the end of a path"),
    Column("end_STRAIN", "", "macroscopic strain at the end of a path"),
    Column("end_STATUS", "", "interface nodes that are bonded, open or closed at the end of a path"),
    Column("load_STRAIN", "", "macroscopic strain under the load of analysis `load`"),
    Column("load_Sij", STRESS, "macroscopic stress under it"),
    Column("load_stored", STRESS, "elastic energy stored under it, per area of the cell"),
    Column("load_STATUS", "", "interface nodes that are bonded, open or closed under it"),
    Column("envelope_AXIS", "that of the axis", "load at onset along the first axis of an envelope"),
    Column("envelope_least_AXIS_AXIS", "that of the axes", "least load at onset of all directions"),
    Column("envelope_largest_AXIS_AXIS", "that of the axes", "largest, if every direction has one"),
    Column("check_LAW", "", "largest relative error of a law, as in result.json"),
    Column("seconds_STAGE", "s", "wall time of a stage, the largest over ranks"),
    Column("memory", "bytes", "peak resident memory, the largest over ranks"),
)
COLUMNS = (*CASE_COLUMNS, *INPUT_COLUMNS, *OUTPUT_COLUMNS)

DATASETS = (
    Column("/cases/COLUMN", "", "`folder`, `point`, `realisation`, `status`, `reason` of each case"),
    Column("/inputs/SECTION.KEY", "that of the key", "of each case"),
    Column("/outputs/COLUMN", "that of the column", "of each case, NaN where there is none"),
    Column("/points/number", "", "the points"),
    Column("/points/SECTION.KEY", "that of the key", "of each point"),
    Column("/statistics/PART/COLUMN", "that of the column", "`count`, `mean`, `std`, `ci95` of each point"),
    Column("/curves/point-K/strain", "", "strains at which the straight paths of a point are compared"),
    Column("/curves/point-K/Sij", STRESS, "stresses there, a row for each realisation"),
    Column("/curves/point-K/Sij_PART", STRESS, "`mean`, `std`, `ci95` of these"),
)
PARTS = ("count", "mean", "std", "ci95")
CASE = ("folder", "point", "realisation", "status", "reason")


def write(directory: Path, table: SweepTable) -> list[Path]:
    """Write both, each in one step; returns their paths.  On one rank.  Raises FetiHomogError if it cannot."""
    writers: tuple[tuple[str, Callable[[SweepTable, Path], None]], ...] = (("sweep.csv", _csv), ("sweep.h5", _hdf5))
    return [atomic.replace(directory / name, partial(writer, table)) for name, writer in writers]


def _csv(table: SweepTable, path: Path) -> None:
    """Write a row for each case; then, for each point, the count, mean, std and ci95 of its realisations.

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
    """Return the value as it stands in the table: nothing for what is not there."""
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
    """Write the inputs of all cases and, except for the seed, of all points."""
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
    """Write a dataset of numbers if all values are numbers, otherwise of texts."""
    column = values if isinstance(values, np.ndarray) else _column(values)
    file[name] = column
    if own_unit:
        file[name].attrs["unit"] = own_unit


def _column(values: list[Any]) -> Any:
    if all(v is None or (isinstance(v, int | float) and not isinstance(v, bool)) for v in values):
        return np.array([np.nan if value is None else value for value in values])
    texts = [v if isinstance(v, str) else "" if v is None else json.dumps(v) for v in values]
    return np.array(texts, dtype=h5py.string_dtype())
