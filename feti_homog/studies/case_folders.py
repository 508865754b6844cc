"""Manage the sweep folder: the case list, a folder for each case, and the progress of the cases.

DIR/sweep.json, cases.csv     the cases; `feti-homog collect` adds the results to cases.csv
DIR/case-0001/case.toml       the case with its defaults, as `feti-homog run` reads it
DIR/case-0001/result.json     the result, as of a single run
DIR/case-0001/error.txt       the reason for a failure
"""

import contextlib
import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

import tomli_w

from feti_homog import __version__
from feti_homog.case import Case
from feti_homog.errors import CaseError, FetiHomogError
from feti_homog.results import atomic, checkpoints, field_file, output_folder, result_json
from feti_homog.schema import types
from feti_homog.studies.sweep_cases import Sweep, SweepCase, identity_of
from feti_homog.system.runtime import file_locks, input_files

INDEX_FILE, TABLE_FILE, ERROR_FILE = output_folder.STUDIES[0], "cases.csv", "error.txt"
CASE_FILE, LOCK_FILE = "case.toml", "lock"
SWEEP_ENTRIES = re.compile(r"(cases|statistics)\.csv|lock|(moduli|peaks)\.png|report\.html|case-\d{4,}")
"""Files and folders that a sweep and its collection write beside sweep.json."""
INDEX_LOCK_FILE, INDEX_LOCK_TIMEOUT_S = "index.lock", 30.0


class Status(StrEnum):
    """The progress of a case.

    An UNCONVERGED case has a result that its checks refuse, a FAILED case only an error.  The result of a DAMAGED case
    is unreadable or of another case.  A RUNNING case is locked, an INTERRUPTED case has events, a WAITING case nothing.
    """

    DONE = "done"
    UNCONVERGED = "not converged"
    FAILED = "failed"
    DAMAGED = "damaged"
    RUNNING = "running"
    INTERRUPTED = "interrupted"
    WAITING = "waiting"

    @property
    def is_failure(self) -> bool:
        """Whether the computation ended without a valid result; --retry repeats such a case."""
        return self in (Status.UNCONVERGED, Status.FAILED)


BEGUN = (Status.RUNNING, Status.INTERRUPTED)
WITHOUT_RESULT = (Status.UNCONVERGED, Status.FAILED, Status.DAMAGED)


@dataclass(frozen=True)
class CaseState:
    """The progress of a case.

    `reason` says why a result is missing or partial; `document` is result.json or an unfinished path, or None.
    """

    status: Status
    reason: str = ""
    document: dict[str, Any] | None = None


def refuse_files_of_others(directory: Path, entries: re.Pattern[str], kind: str) -> None:
    """Refuse a folder that holds another study, or foreign files.  On one rank.

    Raises CaseError for the document of a study, and for a non-empty file or subfolder with a name that matches
    `entries`, unless a subfolder is a sweep; OSError if the folder cannot be read.  `kind` names the new study in the
    message.  A study without its document finds its sweeps, which compare the cases.
    """
    paths = sorted(directory.iterdir())
    for path in paths:
        if path.name in output_folder.STUDIES:
            raise CaseError(f"--out {directory} holds another study, whose file is {path.name}; choose another folder")
    files = [path for path in paths if entries.fullmatch(path.name)]
    for path in files if not any((path / INDEX_FILE).exists() for path in files) else ():
        if any(path.iterdir()) if path.is_dir() else path.lstat().st_size:
            raise output_folder.foreign(directory, path.name, kind)


@contextlib.contextmanager
def document_lock(directory: Path) -> Iterator[None]:
    """Context manager: lock the document of a study during a block.  On one rank.

    Takes no lock if the file system has none.  Raises CaseError if another process holds it for INDEX_LOCK_TIMEOUT_S.
    """
    lock = file_locks.Lock(directory / INDEX_LOCK_FILE, timeout=INDEX_LOCK_TIMEOUT_S)
    try:
        try:
            lock.acquire()
        except file_locks.LocksUnsupported:
            lock.path.unlink(missing_ok=True)
        yield
    except file_locks.LockHeld as error:
        raise CaseError(f"--out {directory}: {error} still writes the document of a study") from error
    finally:
        lock.release()


def prepare_folder(directory: Path, sweep: Sweep) -> None:
    """Make the sweep folder with the list of its cases, or append new cases to a stored list.  On one rank.

    Raises:
        CaseError: the folder cannot be made, has another sweep or foreign files, or its list is unreadable or locked.
        FetiHomogError: the folder cannot be written.
    """
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise CaseError(f"--out {directory}: cannot be made: {error.strerror}") from error
    if refuse_other_sweep(directory, sweep) == sweep.entries and (directory / TABLE_FILE).exists():
        return
    with document_lock(directory):
        stored = refuse_other_sweep(directory, sweep)
        statuses = {stored_state(directory, entry).status for entry in sweep.entries}
        if not stored and (Status.DAMAGED in statuses or Status.DONE not in statuses):  # else it lost its list
            refuse_files_of_others(directory, SWEEP_ENTRIES, "sweep")
        atomic.remove_unfinished(directory, re.compile(rf"{INDEX_FILE}|{TABLE_FILE}"))
        if stored != sweep.entries:
            document = {"version": __version__, "name": sweep.name, "stress_unit": sweep.stress_unit}
            entries = [_replaced(asdict(entry), math.inf, types.INF) for entry in sweep.entries]
            atomic.replace_text(directory / INDEX_FILE, result_json.dumps(document | {"cases": entries}))
        inputs = list(dict.fromkeys(name for entry in sweep.entries for name in entry.inputs))
        table: list[list[Any]] = [["case", "folder", "point", "realisation", *inputs]]
        for entry in sweep.entries:
            values = [entry.inputs.get(name, "") for name in inputs]
            table.append([entry.number, entry.folder, entry.point, entry.realisation, *values])
        atomic.replace_text(directory / TABLE_FILE, result_json.csv_text(table))


def refuse_other_sweep(directory: Path, sweep: Sweep) -> tuple[SweepCase, ...]:
    """Return the stored cases, with which `sweep` must begin; () without a stored list.  On one rank.

    Raises CaseError if the list is unreadable or has other cases.
    """
    stored = read_index(directory).entries if (directory / INDEX_FILE).exists() else ()
    reason = f"it has {len(stored)} cases, this file {len(sweep.entries)}"
    for old, new in zip(stored, sweep.entries, strict=False):
        if old != new:
            reason = f"its {old.folder} ({old.describe('')}) differs from this file ({new.describe('')})"
            if old.inputs == new.inputs:
                in_words = "keys that do not vary, or in the content of a mesh"
                reason = f"its {old.folder} differs from this file in {in_words}"
            break
    if stored != sweep.entries[: len(stored)]:
        raise CaseError(f"--out {directory} holds another sweep: {reason}; choose another folder")
    return stored


def read_index(directory: Path) -> Sweep:
    """Read sweep.json of a sweep folder, without cases.  Raises CaseError if it is missing, unreadable or damaged."""
    path = directory / INDEX_FILE
    try:
        document = result_json.loads(input_files.read(path).decode("utf-8"))
        entries = tuple(SweepCase(**_replaced(entry, types.INF, math.inf)) for entry in document["cases"])
        texts = [document["name"], document["stress_unit"], *(entry.identity for entry in entries)]
        counts = [number for e in entries for number in (e.number, e.point, e.realisation)]
        is_sound = all(type(n) is int and n > 0 for n in counts) and all(isinstance(text, str) for text in texts)
        if not is_sound or not all(0.0 < e.inputs.get("cell.fibre_fraction", 0.5) < 1.0 for e in entries):
            raise TypeError("a name, number or input of a case is missing or of another type")
        return Sweep(document["name"], document["stress_unit"], entries)
    except OSError as error:
        raise CaseError(f"{path}: cannot be read: {error.strerror}; expected the folder of a sweep") from error
    except (AttributeError, ValueError, LookupError, TypeError) as error:
        reason = str(error).removeprefix("it is damaged: ")
        raise CaseError(f"{path} is damaged: {reason}; remove it and run the sweep again: results stay") from error


def _replaced(value: Any, old: Any, new: Any) -> Any:
    """Return nested tables and lists with `new` in place of `old`: JSON has no infinite numbers."""
    if isinstance(value, dict):
        return {key: _replaced(item, old, new) for key, item in value.items()}
    if isinstance(value, list):
        return [_replaced(item, old, new) for item in value]
    return new if value == old else value


def case_state(directory: Path, entry: SweepCase) -> CaseState:
    """Return the progress of a case from its files and lock.  On one rank.

    A case without a result is RUNNING if a process holds its lock.
    """
    state, folder = stored_state(directory, entry), directory / entry.folder
    is_running = bool(file_locks.holder(folder / LOCK_FILE))
    if state.status is not Status.WAITING and not (is_running and state.status is Status.FAILED):
        return state
    document, status = None, Status.WAITING
    with contextlib.suppress(FetiHomogError):  # no event yet, or an unreadable one, which the next run names
        document = output_folder.latest(folder)
        status = Status.INTERRUPTED
    return CaseState(Status.RUNNING if is_running else status, (document or {}).get("unfinished", ""), document)


def stored_state(directory: Path, entry: SweepCase) -> CaseState:
    """Return the progress of a case by result.json and error.txt alone, without lock and events.  On one rank."""
    folder = directory / entry.folder
    path = folder / result_json.NAME
    try:
        if path.exists():
            document = result_json.read(folder)
            if identity_of(document["digest"], document["case"]["petsc"]) != entry.identity:
                return CaseState(Status.DAMAGED, f"{path} is of another case")
            fields, seal = folder / field_file.NAME, document.get("result_h5")
            # Users may remove the fields, which take most of the room.
            if seal is not None and fields.is_file() and fields.stat().st_size != seal["bytes"]:
                return CaseState(Status.DAMAGED, f"{fields} has another size than when it was written")
            return CaseState(Status(document["status"]), "; ".join(document["faults"]), document)
    except (FetiHomogError, KeyError, TypeError, ValueError) as error:
        return CaseState(Status.DAMAGED, f"{path} is not a readable result: {error}")
    if not (folder / ERROR_FILE).is_file():
        return CaseState(Status.WAITING)
    try:
        lines = input_files.read(folder / ERROR_FILE).decode("utf-8", "replace").splitlines()
    except OSError as error:
        lines = [f"{ERROR_FILE} cannot be read: {error.strerror}"]
    return CaseState(Status.FAILED, "; ".join(lines))


def write_case_file(folder: Path, case: Case) -> None:
    """Write case.toml with defaults, without empty sections.  On one rank.  Raises FetiHomogError if that fails."""
    document = {name: table for name, table in case.resolved().items() if table != {}}
    atomic.remove_unfinished(folder, re.compile(rf"{CASE_FILE}|{ERROR_FILE}"))
    atomic.replace_text(folder / CASE_FILE, tomli_w.dumps(document))


def reset(folder: Path, status: Status) -> None:
    """Remove error.txt and events of a case, and `set_aside` its result.  On one rank.  Raises FetiHomogError."""
    with atomic.file_errors("write", folder):
        (folder / ERROR_FILE).unlink(missing_ok=True)
    checkpoints.remove(folder)
    set_aside(folder, status)


def set_aside(folder: Path, status: Status) -> None:
    """Rename result.json to result.json.STATUS; remove other result files.  On one rank.  Raises FetiHomogError."""
    path = folder / result_json.NAME
    with atomic.file_errors("write", folder):
        if path.exists():
            atomic.rename(path, path.with_name(f"{path.name}.{status.replace(' ', '_')}"))
        output_folder.remove_other_results(folder, ())


def write_error(directory: Path, entry: SweepCase, error: FetiHomogError) -> None:
    """Write the lines of `error` to error.txt of a failed case.  On one rank.  Raises FetiHomogError if that fails.

    Raises `error` itself if it refuses to continue a begun path: --retry would discard the events of a failed case.
    """
    if isinstance(error, CaseError) and case_state(directory, entry).document is not None:
        raise error
    lines = [f"{type(error).__name__}: {fault}" for fault in error.faults]
    atomic.replace_text(directory / entry.folder / ERROR_FILE, "\n".join(lines) + "\n")


def failure_lines(cases: Sequence[tuple[SweepCase, CaseState]], stress_unit: str) -> list[str]:
    """Return printable lines with the inputs of failed cases and the reasons of the failures; [] without cases."""
    lines = ["", f"{len(cases)} failed:"] if cases else []
    for entry, state in cases:
        lines += [f"  {entry.folder}  {entry.describe(stress_unit)}", f"    {state.reason}"]
    return lines


def note_lines(entries: Sequence[SweepCase], states: Sequence[CaseState]) -> list[str]:
    """Return warnings and remarks of all results; lines that agree up to a colon become one, with a count of cases."""
    cases, texts = dict[tuple[str, str], list[tuple[str, str]]](), list[str]()
    for kind in ("warning", "remark"):
        for entry, state in zip(entries, states, strict=True):
            for line in (state.document or {}).get(f"{kind}s", ()):
                cases.setdefault((kind, line.partition(": ")[0]), []).append((entry.folder, line))
    for (kind, _), found in cases.items():
        differing = ", some with other numbers" if len({line for _, line in found}) > 1 else ""
        count = f" ({len(found)} cases{differing})" if len(found) > 1 else ""
        texts.append(f"{kind}: {': '.join(found[0])}{count}")
    return texts
