"""The process that a file of it names: its machine, its number and when it began.  Also the files that end with it."""

from __future__ import annotations

import contextlib
import os
import re
import socket
from pathlib import Path

TAG = re.compile(r"(?P<host>.+)\.(?P<process>\d+)\.(?P<began>\d+)")
# Files that are of no use when this process has ended: locks that it holds, and what it writes.
files: set[Path] = set()


def tag() -> str:
    """Return the name of this process, for names of files: no other process has it, neither now nor later."""
    return f"{socket.gethostname()}.{os.getpid()}.{_began(os.getpid())}"


def has_ended(name: str) -> bool:
    """Return whether a `tag` names a process of this machine that has ended; False for other machines."""
    match = TAG.fullmatch(name)
    return match is not None and match["host"] == socket.gethostname() and match["began"] != _began(match["process"])


def remove_files() -> None:
    """Remove the files of this process, which is about to end."""
    for path in tuple(files):
        with contextlib.suppress(OSError):
            path.unlink()


def _began(process: int | str) -> str:
    """Return when a process began, in clock ticks since boot; empty if there is none.  See proc(5)."""
    try:
        return Path(f"/proc/{process}/stat").read_text(errors="replace").rpartition(")")[2].split()[19]
    except OSError:
        return ""
