"""The folder of a sweep: its list of cases, a folder for each, and how far each has come.

DIR/sweep.json, cases.csv     what the cases are; collected, cases.csv has their results too
DIR/case-0001/case.toml       the case with its defaults, which `feti-homog run` runs too
DIR/case-0001/result.json     as of any run
DIR/case-0001/error.txt       why it failed, if it did
"""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

import tomli_w

from feti_homog.case.case import Case
from feti_homog.errors import CaseError, FetiHomogError
from feti_homog.results import atomic, checkpoint_file, output_folder, result_json, seals
from feti_homog.schema.values import INF
from feti_homog.studies.sweep.plan import Sweep, SweepCase, identity_of
from feti_homog.system.runtime import input_files
from feti_homog.system.runtime.file_locks import Lock, LockHeld, is_locked
from feti_homog.version import __version__

INDEX_FILE, TABLE_FILE, ERROR_FILE, CASE_FILE, LOCK_FILE = (
    "sweep.json", "cases.csv", "error.txt", "case.toml", "lock",
)  # fmt: skip
# What a sweep, its collection and its report write beside sweep.json.
SWEEP_ENTRY = re.compile(r"(cases|statistics)\.csv|lock|(moduli|curves)\.png|report\.html|case-\d{4,}")
INDEX_LOCK_FILE, INDEX_LOCK_TIMEOUT_S = "index.lock", 30.0


class Status(StrEnum):
    """Progress of a case.

    UNCONVERGED has a result that its checks refuse, FAILED an error instead; DAMAGED has a result that cannot be
    read or is of another case; WAITING has neither.
    """

    DONE = "done"
    UNCONVERGED = "not converged"
    FAILED = "failed"
    DAMAGED = "damaged"
    RUNNING = "running"
    WAITING = "waiting"

    @property
    def is_failure(self) -> bool:
        """Return whether the case was computed in vain; --retry computes it again."""
        return self in (Status.UNCONVERGED, Status.FAILED)


@dataclass(frozen=True)
class CaseState:
    """Progress of a case, why it did not come further, and its result.json if that is there."""

    status: Status
    reason: str = ""
    document: dict[str, Any] | None = None


@dataclass(frozen=True)
class SweepIndex:
    """Content of sweep.json."""

    name: str
    stress_unit: str
    entries: tuple[SweepCase, ...]


def prepare_folder(directory: Path, sweep: Sweep) -> None:
    """Make the folder of a sweep, or find that it is already that, perhaps with fewer cases.  On one rank.

    Raises:
        CaseError: the folder is that of another sweep, or holds what no sweep wrote under names of its files.
        FetiHomogError: it cannot be written.
    """
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise CaseError(f"--out {directory}: cannot be made: {error.strerror}") from error
    if _existing_entries(directory) == sweep.entries and (directory / TABLE_FILE).exists():
        return
    try:
        with Lock(directory / INDEX_LOCK_FILE, timeout=INDEX_LOCK_TIMEOUT_S):
            known = _existing_entries(directory)
            _refuse_another(directory, known, sweep.entries)
            if not known:
                _refuse_files_of_others(directory)
            atomic.remove_unfinished(directory, re.compile(rf"{INDEX_FILE}|{TABLE_FILE}"))
            if known != sweep.entries:
                document = {"version": __version__, "name": sweep.name, "stress_unit": sweep.stress_unit}
                entries = [_replaced(asdict(entry), math.inf, INF) for entry in sweep.entries]
                atomic.replace_text(directory / INDEX_FILE, seals.dumps(document | {"cases": entries}))
            atomic.replace_text(directory / TABLE_FILE, _table(sweep.entries))
    except LockHeld as error:
        raise CaseError(f"--out {directory}: {error} has been writing its list of cases for long") from error


def _existing_entries(directory: Path) -> tuple[SweepCase, ...]:
    return read_index(directory).entries if (directory / INDEX_FILE).exists() else ()


def read_index(directory: Path) -> SweepIndex:
    """Return the cases of a sweep's folder. Raises CaseError if it is none."""
    path = directory / INDEX_FILE
    try:
        document = seals.loads(input_files.read(path).decode("utf-8"))
        entries = tuple(SweepCase(**_replaced(entry, INF, math.inf)) for entry in document["cases"])
        if not all(isinstance(e.number, int) and isinstance(e.inputs, dict) for e in entries):
            raise TypeError("a case has no number or no inputs")
        return SweepIndex(document["name"], document["stress_unit"], entries)
    except OSError as error:
        raise CaseError(f"{path}: cannot be read: {error.strerror}; expected the folder of a sweep") from error
    except (ValueError, KeyError, TypeError) as error:
        words = str(error).removeprefix("it is damaged: ")
        raise CaseError(f"{path} is damaged: {words}; move it away and start the sweep again") from error


def _replaced(value: Any, old: Any, new: Any) -> Any:
    """Return the value with `new` in place of `old` in all its tables and lists: JSON has no infinite numbers."""
    if isinstance(value, dict):
        return {key: _replaced(item, old, new) for key, item in value.items()}
    if isinstance(value, list):
        return [_replaced(item, old, new) for item in value]
    return new if value == old else value


def case_state(directory: Path, entry: SweepCase) -> CaseState:
    """Return how far a case has come; RUNNING while another process holds its lock.  On one rank."""
    state = stored_state(directory, entry)
    is_open = state.status in (Status.WAITING, Status.FAILED)
    return CaseState(Status.RUNNING) if is_open and is_locked(directory / entry.folder / LOCK_FILE) else state


def stored_state(directory: Path, entry: SweepCase) -> CaseState:
    """Return how far a case has come by its files alone, as the holder of its lock needs it.  On one rank."""
    folder = directory / entry.folder
    try:
        if (folder / result_json.NAME).exists():
            return _result_state(folder, entry)
    except (FetiHomogError, KeyError, TypeError, ValueError) as error:
        return CaseState(Status.DAMAGED, f"{folder / result_json.NAME} is no readable result: {error}")
    if (folder / ERROR_FILE).is_file():
        try:
            lines = input_files.read(folder / ERROR_FILE).decode("utf-8", "replace").splitlines()
        except OSError as error:
            lines = [f"{ERROR_FILE} cannot be read: {error.strerror}"]
        return CaseState(Status.FAILED, "; ".join(lines))
    return CaseState(Status.WAITING)


def _result_state(folder: Path, entry: SweepCase) -> CaseState:
    document = result_json.read(folder)
    if identity_of(document["digest"], document["case"]["petsc"]) != entry.identity:
        return CaseState(Status.DAMAGED, f"{folder / result_json.NAME} is of another case")
    return CaseState(Status(document["status"]), "; ".join(document["faults"]), document)


def write_case_file(directory: Path, entry: SweepCase, case: Case) -> None:
    """Write the file of a case that is to be computed.  On one rank.

    Raises:
        FetiHomogError: the folder cannot be written.
    """
    document = {name: table for name, table in case.resolved().items() if table != {}}
    folder = directory / entry.folder
    atomic.remove_unfinished(folder, re.compile(rf"{CASE_FILE}|{ERROR_FILE}"))
    atomic.replace_text(folder / CASE_FILE, tomli_w.dumps(document))


def reset(directory: Path, entry: SweepCase, status: Status) -> None:
    """Make a case that failed or is damaged one that waits; an unusable result.json is set aside.  On one rank.

    Raises:
        FetiHomogError: the folder cannot be written.
    """
    folder = directory / entry.folder
    try:
        (folder / ERROR_FILE).unlink(missing_ok=True)
    except OSError as error:
        raise FetiHomogError(f"cannot write {folder}: {error.strerror}") from error
    checkpoint_file.remove(folder)
    set_aside(directory, entry, status)


def set_aside(directory: Path, entry: SweepCase, status: Status) -> None:
    """Give the result.json of a case another name, so that the case waits, and remove its other files.  On one rank.

    Raises:
        FetiHomogError: the folder cannot be written.
    """
    folder = directory / entry.folder
    path = folder / result_json.NAME
    with atomic.write_errors(folder):
        if path.exists():
            atomic.rename(path, path.with_name(f"{path.name}.{status.replace(' ', '_')}"))
        output_folder.remove_other_results(folder, ())


def write_error(directory: Path, entry: SweepCase, error: FetiHomogError) -> None:
    """Keep why a case failed.  On one rank.  Raises FetiHomogError if it cannot be written."""
    lines = [f"{type(error).__name__}: {fault}" for fault in error.faults]
    atomic.replace_text(directory / entry.folder / ERROR_FILE, "\n".join(lines) + "\n")


def failure_lines(cases: Sequence[tuple[SweepCase, CaseState]], stress_unit: str) -> list[str]:
    """Folder, inputs and reason of cases that failed, after an empty line and their number; nothing without any."""
    lines = ["", f"{len(cases)} failed:"] if cases else []
    for entry, state in cases:
        lines += [f"  {entry.folder}  {entry.describe(stress_unit)}", f"    {state.reason}"]
    return lines


def _refuse_another(directory: Path, known: Sequence[SweepCase], wanted: Sequence[SweepCase]) -> None:
    """Raise CaseError unless the known cases are the first of those wanted."""
    for old, new in zip(known, wanted, strict=False):
        if old != new:
            words = f"its {old.folder} ({old.describe('')}) differs from this file ({new.describe('')})"
            if old.inputs == new.inputs:
                words = f"its {old.folder} differs from this file in keys that do not vary, or in the content of a mesh"
            raise CaseError(f"--out {directory} holds another sweep: {words}; choose another folder")
    if len(known) > len(wanted):
        raise CaseError(
            f"--out {directory} holds another sweep: it has {len(known)} cases, this file {len(wanted)}; "
            "choose another folder"
        )


def _refuse_files_of_others(directory: Path) -> None:
    """Raise CaseError if something stands where a sweep would write its own, in a folder without a list of cases."""
    for path in sorted(directory.iterdir()):
        if SWEEP_ENTRY.fullmatch(path.name) and (any(path.iterdir()) if path.is_dir() else path.lstat().st_size):
            raise CaseError(
                f"--out {directory}: no sweep of this program wrote {path.name}, and this one would replace it; "
                "move it away or choose another folder"
            )


def _table(entries: Sequence[SweepCase]) -> str:
    names = list(dict.fromkeys(name for entry in entries for name in entry.inputs))
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(["case", "folder", "point", "realisation", *names])
    for entry in entries:
        inputs = [entry.inputs.get(name, "") for name in names]
        writer.writerow([entry.number, entry.folder, entry.point, entry.realisation, *inputs])
    return stream.getvalue()
