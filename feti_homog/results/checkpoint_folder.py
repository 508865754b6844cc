"""The folder of a path's events: its names, what may stand in it, and its removal."""

from __future__ import annotations

import contextlib
import re
from pathlib import Path

from feti_homog.errors import CaseError
from feti_homog.results import atomic

FOLDER, DROPPED = "checkpoint", "checkpoint.dropped"  # the second while it is removed
EVENT_FILE = re.compile(r"\d{6,}\.h5(\..+\.\d+\.part)?")  # also of a writer that was killed


def refuse_others(directory: Path) -> None:
    """Check that a run may write its events to `directory`/checkpoint, and remove them.  Call on one rank.

    Raises:
        CaseError: it is no folder, or something else than events stands in it.
        OSError: it cannot be read.
    """
    for folder in (directory / FOLDER, directory / DROPPED):
        if folder.is_symlink() or (folder.exists() and not folder.is_dir()):
            kind = "link" if folder.is_symlink() else "file"
            raise CaseError(
                f"--out {directory}: {folder.name} is a {kind} there, and a run makes a folder of that name"
            )
        others = [path.name for path in folder.iterdir() if not _is_event(path)] if folder.is_dir() else []
        if others:
            raise CaseError(
                f"--out {directory}: no run of this program wrote {folder.name}/{min(others)}, and a run removes "
                f"{folder.name}; move it away or choose another folder"
            )


def remove(directory: Path) -> None:
    """Remove the events in `directory`: under its own name their folder is there as a whole or not at all.

    Call on one rank.

    Raises:
        FetiHomogError: the folder cannot be renamed.
    """
    folder, dropped = directory / FOLDER, directory / DROPPED
    _remove_events(dropped)
    if folder.is_dir():
        with atomic.file_errors("remove", folder):
            atomic.rename(folder, dropped)
        _remove_events(dropped)


def _remove_events(folder: Path) -> None:
    """Remove events as far as it can be: what stays, the next run removes."""
    with contextlib.suppress(OSError):
        for path in folder.iterdir():
            if _is_event(path):
                path.unlink()
        folder.rmdir()


def _is_event(path: Path) -> bool:
    return EVENT_FILE.fullmatch(path.name) is not None and path.is_file()
