"""Write the tables and the picture of a sweep, finished or not, for `feti-homog collect DIR`."""

import json
import math
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from feti_homog.report.text import constant_tables, point_tables, tables
from feti_homog.results import atomic, result_json
from feti_homog.studies import case_folders
from feti_homog.studies.axes import is_seed
from feti_homog.studies.outputs import numbers, outputs
from feti_homog.studies.predictions import responses
from feti_homog.studies.sweep_cases import Sweep
from feti_homog.studies.sweep_table import PARTS, SweepTable

COUNTS = ("refine", "elements", "nodes", "ranks", "subdomains", "dofs", "multipliers", "iterations", "memory")
MOST_ROWS = 40  # rows of the printed table
CASE = ("folder", "point", "realisation", "status", "reason")


def read(directory: Path) -> SweepTable:
    """Read the table of all cases of a sweep folder.  On one rank.  Raises CaseError without a sound case list."""
    return _table(*_index_and_states(directory))


def collect(directory: Path, pictures: bool) -> list[str]:
    """Write the tables and, with `pictures`, the picture of a sweep to its folder.  On one rank.

    Returns the lines to print.  Raises CaseError like `read`, and FetiHomogError if a file cannot be written.
    """
    index, states = _index_and_states(directory)
    table = _table(index, states)
    atomic.remove_unfinished(directory, re.compile(r"(cases|statistics)\.csv|(moduli|peaks)\.png"), alone=False)
    paths = write(directory, table)
    if pictures:
        from feti_homog.studies.pictures import draw_over_fractions  # only a rank that draws loads Matplotlib

        paths += draw_over_fractions(directory, table)
    counts = ", ".join(f"{count} {status}" for status, count in Counter(table.status).items())
    failed = [(e, s) for e, s in zip(index.entries, states, strict=True) if s.status in case_folders.WITHOUT_RESULT]
    lines = [*case_folders.failure_lines(failed, index.stress_unit), *means(table)]
    if table.rising:
        paths_of_all = sum("path" in document for document in table.finished)
        of_paths = f"{len(table.rising)} of {paths_of_all} paths end before their stress falls"
        lines.append(f"remark: {of_paths}: load them further for a peak")
    lines += case_folders.note_lines(index.entries, states)
    rows = zip(table.folder, table.status, table.reason, strict=True)
    begun = [f"  {folder}  {status}; {reason}" for folder, status, reason in rows if status in case_folders.BEGUN]
    return [f"{len(table.status)} cases: {counts}", *begun, *lines, *map(str, paths)]


def means(table: SweepTable) -> list[str]:
    """Return the lines of printed tables of constants or peaks.

    A point with several realisations has a table of means and scatter; all other points share a table of values.
    """
    known = list(responses(table.finished[0])) if table.finished else []
    names = [name for name in known if name in table.stated]
    shown = constant_tables.shown(known) if "E1" in known else names
    names = [name for name in names if name in shown and not re.match(r"C\d|onset_[^S]", name)] or names
    width = max([22, *(len(tables.with_unit(name, table.stress_unit)) + 2 for name in names)])
    columns = [tables.Column("output", -width), tables.Column("cases", 6, "d"), tables.Column("mean", 13, ".6g")]
    columns += [tables.Column("std"), tables.Column("95 % +-")]
    lines, values = list[str](), list[list[Any]]()
    for number, point in enumerate(table.points):
        parts = {name: [getattr(table.statistics[name], part)[number] for part in PARTS] for name in names}
        rows = [[tables.with_unit(name, table.stress_unit), int(count), *moments]
                for name, (count, *moments) in parts.items() if count > 1]  # fmt: skip
        title = table.label(point) or "All realisations"
        if rows:
            lines += ["", *tables.Table(title, columns, rows).lines]
        elif table.results_of(point):
            values.append([title, *(mean for _, mean, *_ in parts.values())])
    heads = [tables.with_unit(name, table.stress_unit) for name in names]
    columns = [tables.Column("", -max([22, *(len(row[0]) + 4 for row in values)]))]
    columns += [tables.Column(head, max(12, len(head) + 2), ".6g") for head in heads]
    title = "Results" if len(values) <= MOST_ROWS else f"Results, {MOST_ROWS} of {len(values)} points"
    return [*lines, "", *tables.Table(title, columns, values[:MOST_ROWS], most_columns=5).lines] if values else lines


def write(directory: Path, table: SweepTable) -> list[Path]:
    """Write cases.csv and statistics.csv of a sweep, and return their paths.  On one rank.

    Each file is replaced completely or not at all.  Raises FetiHomogError if a file cannot be written.
    """
    numbers_of_cases, progress = range(1, len(table.folder) + 1), (getattr(table, name) for name in CASE)
    columns: list[Sequence[Any]] = [numbers_of_cases, *progress, *table.inputs.values()]
    for name, values in table.outputs.items():
        is_count = name in COUNTS or name.endswith(tuple(f"_{state}" for state in point_tables.STATES))
        columns.append([int(v) if is_count and np.isfinite(v) else v for v in values.tolist()])
    cases: list[Sequence[Any]] = [["case", *CASE, *table.inputs, *table.outputs], *zip(*columns, strict=True)]
    inputs = [name for name in table.inputs if not is_seed(name)]
    statistics: list[Sequence[Any]] = [["point", *inputs, "output", "unit", *PARTS]]
    for number, point in enumerate(table.points):
        at_point = [point, *(table.input_of(point, name) for name in inputs)]
        for name in table.stated:
            count, *moments = (float(getattr(table.statistics[name], part)[number]) for part in PARTS)
            if count:
                statistics.append([*at_point, name, tables.unit(name, table.stress_unit), int(count), *moments])

    def cell(value: Any) -> Any:
        if value is None or (isinstance(value, float) and math.isnan(value)):
            return ""
        return json.dumps(value) if isinstance(value, list | dict) else value

    files = {"cases.csv": cases, "statistics.csv": statistics}
    texts = {name: result_json.csv_text(map(cell, row) for row in rows) for name, rows in files.items()}
    return [atomic.replace_text(directory / name, text) for name, text in texts.items()]


def _index_and_states(directory: Path) -> tuple[Sweep, list[case_folders.CaseState]]:
    index = case_folders.read_index(directory)
    return index, [case_folders.case_state(directory, entry) for entry in index.entries]


def _table(index: Sweep, states: Sequence[case_folders.CaseState]) -> SweepTable:
    documents = [state.document if state.status is case_folders.Status.DONE else None for state in states]
    place = {name: [getattr(entry, name) for entry in index.entries] for name in ("folder", "point", "realisation")}
    inputs = [entry.inputs for entry in index.entries]
    in_names = numbers(row.get("analysis.plane") for row in inputs)
    shown = (case_folders.Status.DONE, *case_folders.BEGUN)
    rows = [outputs(s.document, in_names) if s.document and s.status in shown else {} for s in states]
    return SweepTable(
        name=index.name,
        stress_unit=index.stress_unit,
        **place,
        status=[state.status for state in states],
        reason=[state.reason for state in states],
        inputs=_columns(inputs, None),
        outputs={name: np.array(values) for name, values in _columns(rows, np.nan).items()},
        documents=documents,
    )


def _columns(rows: Sequence[Mapping[str, Any]], missing: Any) -> dict[str, list[Any]]:
    """Transpose rows of named values to a column for each name, with `missing` where a row lacks the name."""
    names = dict.fromkeys(name for row in rows for name in row)
    return {name: [row.get(name, missing) for row in rows] for name in names}
