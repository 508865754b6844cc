"""`feti-homog collect DIR`: one table of what a sweep has come to so far, and its pictures."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from feti_homog.output.text.point_tables import sweep_failures
from feti_homog.sweep import store
from feti_homog.sweep.report import figures, tables
from feti_homog.sweep.report.statistics import Collected, outputs
from feti_homog.sweep.store import BAD, DAMAGED, DONE, Index, State


def read(directory: Path) -> Collected:
    """The table of a sweep's folder, of all its cases, finished or not.  On one rank.

    Raises:
        CaseError: it is no folder of a sweep, or its list of cases is damaged.
    """
    index = store.read_index(directory)
    return _collected(index, [store.state(directory, entry) for entry in index.entries])


def collect(directory: Path, pictures: bool) -> list[str]:
    """Write sweep.csv, sweep.h5 and the pictures to the folder; returns what to tell of it.  On one rank.

    Raises:
        CaseError: as `read`.
        FetiHomogError: a file cannot be written.
    """
    index = store.read_index(directory)
    states = [store.state(directory, entry) for entry in index.entries]
    table = _collected(index, states)
    paths = tables.write(directory, table)
    if pictures:
        paths += figures.plot(directory, table)
    counts = {status: list(table.status).count(status) for status in dict.fromkeys(table.status)}
    words = ", ".join(f"{count} {status}" for status, count in counts.items())
    rows = [
        (entry.folder, entry.words(index.stress_unit), state.reason)
        for entry, state in zip(index.entries, states, strict=True)
        if state.status in (*BAD, DAMAGED)
    ]
    failures = sweep_failures(rows) if rows else []
    return [f"{len(table.status)} cases: {words}", *failures, *map(str, paths)]


def _collected(index: Index, states: Sequence[State]) -> Collected:
    documents = [state.document if state.status == DONE else None for state in states]
    found = [{} if document is None else outputs(document) for document in documents]
    columns = dict.fromkeys(name for row in found for name in row)
    keys = dict.fromkeys(name for entry in index.entries for name in entry.inputs)
    return Collected(
        name=index.name,
        stress_unit=index.stress_unit,
        folder=[entry.folder for entry in index.entries],
        point=[entry.point for entry in index.entries],
        realisation=[entry.realisation for entry in index.entries],
        status=[state.status for state in states],
        reason=[state.reason for state in states],
        inputs={name: [entry.inputs.get(name) for entry in index.entries] for name in keys},
        outputs={name: np.array([row.get(name, np.nan) for row in found]) for name in columns},
        documents=documents,
    )
