"""cases.csv and statistics.csv: the table of a sweep and its statistics."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from feti_homog.materials.constants import EngineeringConstants, Moduli, TransverseIsotropy
from feti_homog.report.text.point_tables import STATES
from feti_homog.report.text.table import unit
from feti_homog.results import atomic
from feti_homog.results.result_json import DescribedColumn as Column
from feti_homog.results.result_json import columns
from feti_homog.studies.sweep.report.sweep_table import SweepTable
from feti_homog.system.runtime.records import STRESS

CASE_COLUMNS = (
    Column("case", "", "number of the case, from 1"),
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
    Column("refine", "", "halvings of the mesh"),
    Column("elements", "", "triangles of the refined mesh"),
    Column("nodes", "", "nodes of the refined mesh, once for each body in each subdomain: depends on ranks"),
    Column("ranks", "", "MPI ranks"),
    Column("subdomains", "", "subdomains that the bodies are cut into"),
    Column("dofs", "", "degrees of freedom of all subdomains"),
    Column("multipliers", "", "Lagrange multipliers of the dual problem"),
    Column("iterations", "", "Krylov iterations of all states"),
    Column("Cij", STRESS, "entry of L^ef; beside generalized plane strain C66 is the shear modulus of all"),
    Column("Cij_compression", STRESS, "the same under minus the unit strains, with contact"),
    Column("thermal_Sij", f"{STRESS} per unit of temperature", "stress per unit of temperature at no strain"),
    Column("expansion_x1", "1 / temperature", "strain along x1 per unit of temperature at no stress; expansion_x2 too"),
    Column("expansion_STRAIN", "1 / temperature", "the same of a shear strain"),
    Column("anisotropy_normal", STRESS, "C11 - C22"),
    Column("anisotropy_shear", STRESS, "C33 - (C11 + C22 - 2 C12) / 4; with generalized plane strain C66 - ..."),
    *columns(Moduli),
    *(column for column in columns(EngineeringConstants) if column.name not in MODULI),
    *columns(TransverseIsotropy),
    Column("NAME_mesh_error", "that of NAME", "estimated error of an entry or constant by its mesh"),
    Column("energy_mesh_error", "", "estimated relative error of the strain energy, the largest under any strain"),
    Column("Cii_reuss", STRESS, "lower bound of Cii"),
    Column("Cii_voigt", STRESS, "upper bound of Cii"),
    Column("bulk_lower", STRESS, "lower bound of bulk, by Hashin and Shtrikman"),
    Column("bulk_upper", STRESS, "upper bound of bulk, by Hashin and Shtrikman"),
    Column("shear_lower", STRESS, "lower bound of shear, by Hashin and Shtrikman"),
    Column("shear_upper", STRESS, "upper bound of shear, by Hashin and Shtrikman"),
    Column("angle_ANGLE_Cij", STRESS, "entry of L^ef at an opening of that many degrees"),
    Column("angle_ANGLE_Sij", STRESS, "macroscopic stress at an opening of that many degrees"),
    Column("onset_load_factor", "", "load factor at which the first bond of a path breaks or softens"),
    Column("dissipated", STRESS, "energy lost to all breaks of a path, per area of the cell"),
    Column("work", STRESS, "work of the loads along a path, per area of the cell"),
    Column("onset_Sij", STRESS, "macroscopic stress where the first bond of a path breaks or softens"),
    Column("onset_STRAIN", "", "macroscopic strain where the first bond of a path breaks or softens"),
    Column(
        "peak_Sij",
        STRESS,
        "largest in magnitude of a path, with its sign, also where it ends before it falls; of the leading strain as "
        "`peak` has it",
    ),
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
STATISTICS_COLUMNS = (
    Column("point", "", "number of the point, from 1"),
    *INPUT_COLUMNS,
    Column("output", "", "name of a column of cases.csv"),
    Column("unit", "", "its unit"),
    Column("count", "", "finished realisations of the point that have it"),
    Column("mean", "that of the output", "mean over them"),
    Column("std", "that of the output", "standard deviation, from two on"),
    Column("ci95", "that of the output", "half the width of the 95 % confidence interval of the mean"),
)

PARTS = ("count", "mean", "std", "ci95")
COUNTS = ("refine", "elements", "nodes", "ranks", "subdomains", "dofs", "multipliers", "iterations", "memory")
CASE = ("folder", "point", "realisation", "status", "reason")


def write(directory: Path, table: SweepTable) -> list[Path]:
    """Write both, each in one step; returns their paths.  On one rank.  Raises FetiHomogError if it cannot."""
    rows = {"cases.csv": _case_rows, "statistics.csv": _statistics_rows}
    return [atomic.replace(directory / name, partial(_csv, own, table)) for name, own in rows.items()]


def _csv(rows: Callable[[SweepTable], Iterator[list[Any]]], table: SweepTable, path: Path) -> None:
    """Write rows of cells, the first of which are the names of the columns."""
    with path.open("w", newline="", encoding="utf-8") as stream:
        csv.writer(stream, lineterminator="\n").writerows(map(_cell, row) for row in rows(table))


def _case_rows(table: SweepTable) -> Iterator[list[Any]]:
    """Yield a row for each case."""
    yield ["case", *CASE, *table.inputs, *table.outputs]
    outputs = [
        [int(value) if np.isfinite(value) else value for value in values.tolist()]
        if is_count(name)
        else values.tolist()
        for name, values in table.outputs.items()
    ]
    for row, _ in enumerate(table.folder):
        own = [values[row] for values in (*table.inputs.values(), *outputs)]
        yield [row + 1, *(getattr(table, name)[row] for name in CASE), *own]


def _statistics_rows(table: SweepTable) -> Iterator[list[Any]]:
    """Yield a row for each point and output, of those with a result."""
    inputs = [name for name in table.inputs if name != "cell.seed"]
    yield ["point", *inputs, "output", "unit", *PARTS]
    for number, point in enumerate(table.points):
        own = [point, *(table.input_of(point, name) for name in inputs)]
        for name, statistics in table.statistics.items():
            count, *others = (float(getattr(statistics, part)[number]) for part in PARTS)
            if count:
                yield [*own, name, unit(name, table.stress_unit), int(count), *others]


def is_count(name: str) -> bool:
    """Return whether an output is an integer."""
    return name in COUNTS or name.endswith(tuple(f"_{state}" for state in STATES))


def _cell(value: Any) -> Any:
    """Return the value as it stands in the table: nothing for what is not there."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    return json.dumps(value) if isinstance(value, list | dict) else value
