"""The one file that a command makes instead of printing what it is for: a card, a table of fibres."""

from __future__ import annotations

from pathlib import Path

from feti_homog.errors import CaseError
from feti_homog.results import atomic, output_folder


def write(path: Path, text: str) -> Path:
    """Write a text to a file, whole or not at all; returns its path.

    Raises:
        CaseError: `path` is a folder, in no folder, or a file of a result.
        FetiHomogError: it cannot be written.
    """
    if path.is_dir():
        raise CaseError(f"--out {path}: expected a file, but it is a folder")
    if not path.parent.is_dir():
        raise CaseError(f"--out {path}: expected a file in a folder that there is")
    if output_folder.RESULT_FILE.fullmatch(path.name):
        raise CaseError(f"--out {path}: expected another name; results have files of that name")
    return atomic.replace_text(path, f"{text}\n")
