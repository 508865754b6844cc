"""What stands in a folder before a run writes there: files of earlier runs, which it replaces, or somebody's own."""

from __future__ import annotations

import json
from pathlib import Path

from feti_homog.errors import CaseError
from feti_homog.results import checkpoint, event_log, field_file, output_folder, result_json
from feti_homog.results.field_layout import PROGRAM

HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"
HEAD = 1 << 20  # bytes of result.h5 in which its attributes are
# The files that show that a run has written to the folder.
SIGNS = (result_json.NAME, field_file.NAME, event_log.NAME, output_folder.LOCK)


def refuse_files_of_others(directory: Path) -> None:
    """Check that a run may write all its files to `directory`, and replace those that are there.  Call on one rank.

    Raises:
        CaseError: a folder stands where a file is to be or the other way round, or a file has the name of a run's and
            no run wrote it.
    """
    if not directory.is_dir():
        return
    try:
        names = sorted(path.name for path in directory.iterdir())
        _refuse_wrong_kinds(directory, names)
        _refuse_foreign(
            directory, [name for name in names if name in SIGNS or output_folder.RESULT_FILE.fullmatch(name)]
        )
    except OSError as error:
        raise CaseError(f"--out {directory}: its files cannot be read: {error.strerror}") from error


def _refuse_wrong_kinds(directory: Path, names: list[str]) -> None:
    for path in (directory / name for name in names if name in SIGNS or output_folder.RESULT_FILE.fullmatch(name)):
        kind = "a folder there" if path.is_dir() else "a link there that leads nowhere" if not path.exists() else ""
        if kind:
            raise CaseError(f"--out {directory}: {path.name} is {kind}, and a run writes a file of that name")
    checkpoint.refuse_others(directory)


def _refuse_foreign(directory: Path, names: list[str]) -> None:
    filled = [name for name in names if (directory / name).stat().st_size]
    foreign = [name for name in filled if name in SIGNS and not _is_own(directory / name)]
    if not any(name in SIGNS for name in names):
        foreign = filled
    if foreign:
        raise CaseError(
            f"--out {directory}: no run of this program wrote {foreign[0]}, and this one would replace it; "
            "move it away or choose another folder"
        )


def _is_own(path: Path) -> bool:
    """Whether a run wrote this result.json, of whatever version, result.h5 or events.log."""
    if path.name == result_json.NAME:
        try:
            document = json.loads(path.read_text(encoding="utf-8"))
        except ValueError:
            return False
        return isinstance(document, dict) and {"version", "case", "solver"} <= document.keys()
    if path.name == field_file.NAME:
        with path.open("rb") as stream:
            head = stream.read(HEAD)
        return head.startswith(HDF5_SIGNATURE) and PROGRAM.encode() in head
    if path.name == event_log.NAME:
        with path.open("rb") as stream:
            return stream.read(len(event_log.HEADER)) == event_log.HEADER.encode()
    return True
