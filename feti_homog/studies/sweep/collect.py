"""`feti-homog collect DIR`: one table of what a sweep has come to so far, and its pictures."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from feti_homog.results import atomic
from feti_homog.studies.sweep import store
from feti_homog.studies.sweep.plan import SweepCase
from feti_homog.studies.sweep.report import figures, tables
from feti_homog.studies.sweep.report.outputs import numbers, outputs
from feti_homog.studies.sweep.report.sweep_table import SweepTable
from feti_homog.studies.sweep.store import CaseState, Status, SweepIndex
from feti_homog.typing import Float


def read(directory: Path) -> SweepTable:
    """Return the table of a sweep's folder, of all its cases, finished or not. On one rank.

    Raises:
        CaseError: it is no folder of a sweep, or its list of cases is damaged.
    """
    return _table(*_index_and_states(directory))


def collect(directory: Path, pictures: bool) -> list[str]:
    """Write cases.csv, statistics.csv and the pictures; returns the lines to print.  On one rank.

    Raises:
        CaseError: as `read`.
        FetiHomogError: a file cannot be written.
    """
    index, states = _index_and_states(directory)
    table = _table(index, states)
    atomic.remove_unfinished(directory, re.compile(r"(cases|statistics)\.csv|(moduli|curves)\.png"), alone=False)
    paths = tables.write(directory, table)
    if pictures:
        paths += figures.plot(directory, table)
    counts = ", ".join(f"{count} {status}" for status, count in Counter(table.status).items())
    failed = [
        (entry, state)
        for entry, state in zip(index.entries, states, strict=True)
        if state.status.is_failure or state.status is Status.DAMAGED
    ]
    failures = store.failure_lines(failed, index.stress_unit)
    return [f"{len(table.status)} cases: {counts}", *failures, *map(str, paths)]


def _index_and_states(directory: Path) -> tuple[SweepIndex, list[CaseState]]:
    index = store.read_index(directory)
    return index, [store.case_state(directory, entry) for entry in index.entries]


def _table(index: SweepIndex, states: Sequence[CaseState]) -> SweepTable:
    documents = [state.document if state.status is Status.DONE else None for state in states]
    own = numbers(entry.inputs.get("analysis.plane") for entry in index.entries)
    return SweepTable(
        name=index.name,
        stress_unit=index.stress_unit,
        folder=[entry.folder for entry in index.entries],
        point=[entry.point for entry in index.entries],
        realisation=[entry.realisation for entry in index.entries],
        status=[state.status for state in states],
        reason=[state.reason for state in states],
        inputs=_inputs(index.entries),
        outputs=_columns([{} if document is None else outputs(document, own) for document in documents]),
        documents=documents,
    )


def _inputs(entries: Sequence[SweepCase]) -> dict[str, list[Any]]:
    """Return the values of each key that varies in all cases, None where a case has none."""
    names = dict.fromkeys(name for entry in entries for name in entry.inputs)
    return {name: [entry.inputs.get(name) for entry in entries] for name in names}


def _columns(rows: Sequence[Mapping[str, float]]) -> dict[str, Float]:
    """Return the values of each name in all rows, NaN where a row has none."""
    names = dict.fromkeys(name for row in rows for name in row)
    return {name: np.array([row.get(name, np.nan) for row in rows]) for name in names}
