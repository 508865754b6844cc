"""Read stored results, and check that the files in a folder are complete and from one run."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NoReturn

from feti_homog.analysis.result import Result
from feti_homog.case import Case, cases, sections, toml_files
from feti_homog.errors import CaseError
from feti_homog.materials import voigt
from feti_homog.results import checkpoints, field_file, field_guard, output_folder, result_json
from feti_homog.schema import keys, wording


def read(directory: Path) -> dict[str, Any]:
    """Read the document of a result or unfinished path; check result.h5 if the case stores fields.  Call on one rank.

    Raises CaseError if a file is missing, damaged, or from another program or run.
    """
    document = output_folder.latest(directory)
    result = _restored(directory, document)
    if "unfinished" in document:
        size = len(voigt.plane_state_of(document).components)
        points = result.path or ()
        if not all(0.0 < p.load_factor <= 1.0 and len(p.strain) == len(p.stress) == size for p in points):
            raise CaseError(f"{directory / checkpoints.FOLDER}: it is damaged: its points do not fit its case")
    elif result.case["output"].get("fields", True):
        _check_fields(directory, result)
    return document


def check_to_draw(directory: Path) -> str:
    """Check that the files in `directory` from which pictures are drawn belong to one run.  Call on one rank.

    Without result.json and checkpoint, result.h5 must exist.  Returns a phrase with points and load of an unfinished
    path, else "".  Raises CaseError if a needed file is missing, or a file is damaged, or from another program or run.
    """
    # `lexists` is also true for a circular link.
    if os.path.lexists(directory / result_json.NAME) or (directory / checkpoints.FOLDER).is_dir():
        return str(read(directory).get("unfinished", ""))
    field_guard.require_own(directory / field_file.NAME)
    return ""


def finished(directory: Path, case: Case, ranks: int) -> bool:
    """Return whether a folder has the finished result of a case, with its fields, and no checkpoint.  Call on one rank.

    Raises CaseError if the result or checkpoint is damaged or of another case, or the checkpoint of another rank count.
    """
    path = directory / checkpoints.FOLDER / checkpoints.NAME
    if path.parent.is_dir():
        content = b""
        try:
            if path.is_file():
                _, content = next(checkpoints.records(path), (0, b""))
        except CaseError as error:
            raise CaseError(f"--resume: {error}") from error
        signature, _, opening = content.decode().partition("\n")
        is_alike = f"case {case.digest(False)}," in signature and f" on {ranks} ranks" in signature
        if opening and not is_alike:  # events are the same for any [output]
            _refuse_other(f"{directory} holds the events", result_json.loads(opening), case, ranks, "output")
        return False
    if not (directory / result_json.NAME).is_file():
        return False
    document = result_json.read(directory)
    result = _restored(directory, document)
    if result.digest != case.digest():
        _refuse_other(f"{directory} holds the result", document, case, result.solver.ranks)
    if case.output.fields:
        if not (directory / field_file.NAME).exists():
            return False
        _check_fields(directory, result)
    return result.status == "done"


def _refuse_other(start: str, stored: Mapping[str, Any], case: Case, ranks: int, skipped: str = "name") -> NoReturn:
    """Raise CaseError with `start` and the keys or ranks that differ from the document `stored`, except `skipped`."""
    idle = [("output", name) for name, entry in keys.keys_of(sections.Output).items() if entry.presentation]
    idle += [("path", "max_events"), ("cell", "file"), ("cell", "match")]  # the digest has the content of files
    ignored, n_before = ("name", "petsc", skipped), stored["solver"]["ranks"]

    def compared(document: Mapping[str, Any], count: int) -> dict[tuple[str, ...], Any]:
        leaves = toml_files.leaves(_numbered({**document, "ranks": count}))
        return {path: value for path, value in leaves if path[0] not in ignored and path not in idle}

    before, now = compared(stored["case"], n_before), compared(case.resolved(), ranks)
    lines = []
    for path in now | before:
        if before.get(path) != now.get(path):
            old, new = (wording.toml_value(of[path]) if path in of else "none" for of in (before, now))
            lines.append(f"{wording.dotted_key(path)}: {old} now {new}")
    if n_before != ranks and len(lines) == 1:
        way = "go on with as many (--ranks-per-case of a study), or choose another folder"
        raise CaseError(f"--resume: {start} of a run on {n_before} ranks; {way}")
    where = ", ".join(lines) or f"the content of {case.cell.file or case.cell.match or 'result.json'}"
    raise CaseError(f"--resume: {start} of another case, which differs in {where}; choose another folder")


def _numbered(value: Any) -> Any:
    """Return nested tables with a table, by number from 1, in place of each list."""
    entries = {str(k): entry for k, entry in enumerate(value, 1)} if isinstance(value, list) else value
    return {name: _numbered(entry) for name, entry in entries.items()} if isinstance(entries, dict) else value


def _restored(directory: Path, document: Mapping[str, Any]) -> Result:
    try:
        if "unfinished" in document:  # checks and faults follow at the end
            document = {**document, "faults": (), "checks": {"strain": 0.0, "hill": 0.0, **document["checks"]}}
        result = Result.of(document)
        cases.check_stored(result.case)
        if "output" not in result.case:
            raise TypeError("its case has no [output]")
        return result
    except CaseError as error:
        raise CaseError(f"{directory / result_json.NAME}: its case is damaged: {error.faults[0]}") from error
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        path, place = directory / result_json.NAME, f"{type(error).__name__}: {error}"
        raise CaseError(f"{path}: it is damaged, or no result of this program ({place})") from error


def _check_fields(directory: Path, result: Result) -> None:
    path = directory / field_file.NAME
    if result.result_h5 is not None and path.is_file():
        result_json.check(path, result.result_h5)
    field_guard.require_own(path)
