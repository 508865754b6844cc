"""The folder of a sweep: its list of cases, a folder for each, and how far each has come.

DIR/sweep.json, cases.csv     what the cases are
DIR/case-0001/case.toml       the case with its defaults, which `feti-homog run` runs too
DIR/case-0001/result.json     as of any run
DIR/case-0001/error.txt       why it failed, if it did
"""

from __future__ import annotations

import csv
import io
import json
import shutil
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import tomli_w

from feti_homog import __version__
from feti_homog.common.file_locks import Busy, Lock, is_held
from feti_homog.config.case import Case
from feti_homog.errors import CaseError, FetiHomogError
from feti_homog.output.files import atomic, checkpoint, result_json
from feti_homog.sweep.plan import Entry, Sweep, identity_of

INDEX, TABLE, ERROR, CASE, LOCK = "sweep.json", "cases.csv", "error.txt", "case.toml", "lock"
DONE, UNCONVERGED, FAILED, DAMAGED, RUNNING, WAITING = (
    "done", "not converged", "failed", "damaged", "running", "waiting",
)  # fmt: skip
BAD = (UNCONVERGED, FAILED)


@dataclass(frozen=True)
class State:
    """How far a case has come, why it did not come further, and its result.json if that is there."""

    status: str
    reason: str = ""
    document: dict[str, Any] | None = None


@dataclass(frozen=True)
class Index:
    """What sweep.json says."""

    name: str
    stress_unit: str
    entries: tuple[Entry, ...]


def prepare(directory: Path, sweep: Sweep) -> None:
    """Make the folder of a sweep, or find that it is already that, perhaps with fewer cases.  On one rank.

    Raises:
        CaseError: the folder is that of another sweep.
        FetiHomogError: it cannot be written.
    """
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise CaseError(f"--out {directory}: cannot be made: {error.strerror}") from error
    if _known(directory) == sweep.entries:
        return
    try:
        with Lock(directory / "index.lock", patience=30.0):
            known = _known(directory)
            _refuse_another(directory, known, sweep.entries)
            if known != sweep.entries:
                atomic.replace_text(directory / TABLE, _table(sweep.entries))
                document = {"version": __version__, "name": sweep.name, "stress_unit": sweep.stress_unit}
                entries = [asdict(entry) for entry in sweep.entries]
                atomic.replace_text(directory / INDEX, json.dumps(document | {"cases": entries}, indent=1) + "\n")
    except Busy as busy:
        raise CaseError(f"--out {directory}: {busy} has been writing its list of cases for long") from busy


def _known(directory: Path) -> tuple[Entry, ...]:
    return read_index(directory).entries if (directory / INDEX).exists() else ()


def read_index(directory: Path) -> Index:
    """The cases of a sweep's folder.  Raises CaseError if it is none."""
    path = directory / INDEX
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
        entries = tuple(Entry(**entry) for entry in document["cases"])
        return Index(document["name"], document["stress_unit"], entries)
    except OSError as error:
        raise CaseError(f"{path}: cannot be read: {error.strerror}; expected the folder of a sweep") from error
    except (ValueError, KeyError, TypeError) as error:
        raise CaseError(f"{path} is damaged: {error}; move it away and start the sweep again") from error


def state(directory: Path, entry: Entry, own: bool = False) -> State:
    """How far a case has come; with `own`, for the holder of its lock: never "running".  On one rank."""
    folder = directory / entry.folder
    try:
        if (folder / result_json.NAME).exists():
            document = result_json.read(folder)
            identity = identity_of(document["digest"], document["case"]["petsc"])
            if identity != entry.identity:
                return State(DAMAGED, f"{folder / result_json.NAME} is of another case")
            return State(document["status"], "; ".join(document["faults"]), document)
    except (FetiHomogError, KeyError, TypeError) as error:
        return State(DAMAGED, f"{folder / result_json.NAME} is no readable result: {error}")
    if not own and is_held(folder / LOCK):
        return State(RUNNING)
    if (folder / ERROR).exists():
        return State(FAILED, "; ".join((folder / ERROR).read_text(encoding="utf-8").splitlines()))
    return State(WAITING)


def begin(directory: Path, entry: Entry, case: Case) -> None:
    """Write the file of a case that is to be computed.  On one rank.

    Raises:
        FetiHomogError: the folder cannot be written.
    """
    document = {name: table for name, table in case.resolved().items() if table != {}}
    atomic.replace_text(directory / entry.folder / CASE, tomli_w.dumps(document))


def forget(directory: Path, entry: Entry, status: str) -> None:
    """Make a case that failed or is damaged one that waits; an unusable result.json is set aside.  On one rank.

    Raises:
        FetiHomogError: the folder cannot be written.
    """
    folder = directory / entry.folder
    try:
        (folder / ERROR).unlink(missing_ok=True)
        shutil.rmtree(folder / checkpoint.FOLDER, ignore_errors=True)
        if (folder / result_json.NAME).exists():
            atomic.rename(folder / result_json.NAME, folder / f"{result_json.NAME}.{status.replace(' ', '_')}")
    except OSError as error:
        raise FetiHomogError(f"cannot write {folder}: {error.strerror}") from error


def fail(directory: Path, entry: Entry, error: FetiHomogError) -> None:
    """Keep why a case failed.  On one rank.  Raises FetiHomogError if it cannot be written."""
    lines = [f"{type(error).__name__}: {fault}" for fault in error.faults]
    atomic.replace_text(directory / entry.folder / ERROR, "\n".join(lines) + "\n")


def _refuse_another(directory: Path, known: Sequence[Entry], wanted: Sequence[Entry]) -> None:
    """Raises CaseError unless the known cases are the first of those wanted."""
    for old, new in zip(known, wanted, strict=False):
        if old != new:
            words = f"its {old.folder} ({old.words('')}) differs from that of this file ({new.words('')})"
            raise CaseError(f"--out {directory} holds another sweep: {words}; choose another folder")
    if len(known) > len(wanted):
        raise CaseError(
            f"--out {directory} holds another sweep: it has {len(known)} cases, this file {len(wanted)}; "
            "choose another folder"
        )


def _table(entries: Sequence[Entry]) -> str:
    names = list(dict.fromkeys(name for entry in entries for name in entry.inputs))
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(["case", "folder", "point", "realisation", *names])
    for entry in entries:
        inputs = [entry.inputs.get(name, "") for name in names]
        writer.writerow([entry.number, entry.folder, entry.point, entry.realisation, *inputs])
    return stream.getvalue()
