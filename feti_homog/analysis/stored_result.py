"""Read stored results, and check that the files of a folder are complete and from one run."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from feti_homog.analysis.result import Result
from feti_homog.case import Case, cases
from feti_homog.errors import CaseError
from feti_homog.results import checkpoints, field_file, field_guard, output_folder, result_json


def read(directory: Path) -> dict[str, Any]:
    """Read a result, checked with result.h5 if the case keeps fields, or an unfinished path.  Call on one rank.

    Raises:
        CaseError: a file is missing, damaged, or from another program or run.
    """
    document = output_folder.latest(directory)
    if "unfinished" not in document:
        result = _restored(directory, document)
        if result.case["output"].get("fields", True):
            _check_fields(directory, result)
    return document


def check_to_draw(directory: Path) -> str:
    """Check that the plottable files in `directory` belong to one run.  Call on one rank.

    The file result.h5 is required, result.json is optional.  Returns the status of an unfinished path, else nothing.

    Raises:
        CaseError: result.h5 is missing, or a file is damaged, or from another program or run.
    """
    # Also true for a circular link.
    if os.path.lexists(directory / result_json.NAME) or (directory / checkpoints.FOLDER).is_dir():
        return str(read(directory).get("unfinished", ""))
    field_guard.require_own(directory / field_file.NAME)
    return ""


def finished(directory: Path, case: Case) -> bool:
    """Return whether a folder without checkpoint has a case's whole result.  Call on one rank.

    Raises:
        CaseError: the result is damaged, or belongs to another case.
    """
    if (directory / checkpoints.FOLDER).is_dir() or not (directory / result_json.NAME).is_file():
        return False
    result = _restored(directory, result_json.read(directory))
    if result.digest != case.digest():
        now = case.resolved()
        changed = [f"[{k}]" for k in now if k not in ("name", "petsc") and now[k] != result.case.get(k)]
        where = f", which differs in {', '.join(changed)}" if changed else ""
        raise CaseError(f"--resume: {directory} holds the result of another case{where}; choose another folder")
    if case.output.fields:
        if not (directory / field_file.NAME).exists():
            return False
        _check_fields(directory, result)
    return result.status == "done"


def _restored(directory: Path, document: Mapping[str, Any]) -> Result:
    try:
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
