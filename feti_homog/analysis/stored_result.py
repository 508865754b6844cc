"""Read stored results, and check that the files of a folder are complete and from one run."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from feti_homog.analysis.result import Result
from feti_homog.case import Case, cases, sections, toml_files
from feti_homog.errors import CaseError
from feti_homog.results import checkpoints, field_file, field_guard, output_folder, result_json
from feti_homog.schema import keys, wording


def read(directory: Path) -> dict[str, Any]:
    """Read a result, checked with result.h5 if the case keeps fields, or an unfinished path.  Call on one rank.

    Raises:
        CaseError: a file is missing, damaged, or from another program or run.
    """
    document = output_folder.latest(directory)
    if "unfinished" not in document:
        result = _restored(directory, document)
        if output_folder.has_fields(document):
            _check_fields(directory, result)
    return document


def check_to_draw(directory: Path) -> str:
    """Check that the plottable files in `directory` belong to one run.  Call on one rank.

    The file result.h5 is required, result.json is optional.  Returns a line on fields that are missing, or nothing.

    Raises:
        CaseError: result.h5 is missing, or a file is damaged, or from another program or run.
    """
    # Also true for a circular link.
    if os.path.lexists(directory / result_json.NAME) or (directory / checkpoints.FOLDER).is_dir():
        document = read(directory)
        if "unfinished" in document:
            return f"{directory}: {document['unfinished']}; pictures of its fields follow at its end"
        is_whole = output_folder.has_fields(document) or not document["case"]["output"].get("fields", True)
        return "" if is_whole else f"{directory}: without fields: {document['faults'][-1]}"
    field_guard.require_own(directory / field_file.NAME)
    return ""


def finished(directory: Path, case: Case, ranks: int) -> bool:
    """Return whether a folder without checkpoint has a case's whole result.  Call on one rank.

    Raises:
        CaseError: the result is damaged or belongs to another case, the checkpoint also to another number of ranks.
    """
    path = directory / checkpoints.FOLDER / checkpoints.NAME
    if path.parent.is_dir():
        try:
            content = next(checkpoints.records(path), (0, b""))[1] if path.is_file() else b""
        except CaseError as error:
            raise CaseError(f"--resume: {error}") from error
        signature, _, opening = content.decode().partition("\n")
        stored = result_json.loads(opening or "{}")
        is_alike = f"case {case.digest(False)}," in signature and f" on {ranks} ranks" in signature
        if stored and not is_alike:  # events are the same for any [output]
            raise _of_another(f"--resume: {directory} holds the events of another run", stored, case, ranks, "output")
        return False
    if not (directory / result_json.NAME).is_file():
        return False
    result = _restored(directory, document := result_json.read(directory))
    if result.digest != case.digest():
        raise _of_another(f"--resume: {directory} holds the result of another case", document, case)
    if case.output.fields:
        if not (directory / field_file.NAME).exists():
            return False
        _check_fields(directory, result)
    return result.status == "done"


def _of_another(
    line: str, stored: Mapping[str, Any], case: Case, ranks: int | None = None, skipped: str = "name"
) -> CaseError:
    """Return the error with the keys in which a case, or its `ranks`, differ from a stored run."""
    before, now = (dict(toml_files.leaves(document)) for document in (stored["case"], case.resolved()))
    idle = [("output", name) for name, entry in keys.keys_of(sections.Output).items() if entry.presentation]
    idle += [("path", "max_events"), ("cell", "file"), ("cell", "match")]  # the digest has the content of files
    paths = [path for path in now | before if path[0] not in ("name", "petsc", skipped) and path not in idle]
    lines = [f"{wording.dotted_key(path)}: {' now '.join(map(wording.toml_value, values))}" for path in paths
             if (values := (before.get(path, "none"), now.get(path, "none")))[0] != values[1]]  # fmt: skip
    if ranks not in (None, was := stored["solver"]["ranks"]):
        lines.append(f"ranks: {was} now {ranks}")
    where = f", which differs in {', '.join(lines)}" if lines else ""
    return CaseError(f"{line}{where}; choose another folder")


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
