"""The folder that results go to."""

from __future__ import annotations

import os
from pathlib import Path

from feti_homog.errors import CaseError


def usable(directory: Path) -> None:
    """Check that `directory` is one, or can be made, and can be written to; nothing is made yet.

    Raises:
        CaseError: it cannot be used.
    """
    there = next(p for p in (directory.absolute(), *directory.absolute().parents) if p.exists())
    if not there.is_dir():
        raise CaseError(f"--out {directory}: expected a folder, but {there} is a file")
    if not os.access(there, os.W_OK | os.X_OK):
        raise CaseError(f"--out {directory}: expected a folder that can be written to; {there} cannot")


def make(directory: Path) -> None:
    """Make `directory` with its parents.

    Raises:
        CaseError: it cannot be made.
    """
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise CaseError(f"--out {directory}: cannot be made: {error.strerror}") from error
