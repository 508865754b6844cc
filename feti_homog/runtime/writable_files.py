"""Whether a library will be able to open a file, asked before any work."""

from __future__ import annotations

import os
import stat


def can_be_written(file: str) -> bool:
    """Return whether a file of this name can be opened for writing: there is one that can, or a folder for it.

    A pipe can if somebody reads from it; else opening it would wait.
    """
    if not file or "\0" in file or file.endswith(os.sep):
        return False
    try:
        kind = os.stat(file).st_mode
    except FileNotFoundError:
        folder = os.path.dirname(os.path.realpath(file))
        return os.path.isdir(folder) and os.access(folder, os.W_OK | os.X_OK)
    except OSError:  # too long a name, a file for a folder, links in a circle
        return False
    if stat.S_ISFIFO(kind):
        return _has_reader(file)
    return not stat.S_ISDIR(kind) and os.access(file, os.W_OK)


def can_be_read(file: str) -> bool:
    """Return whether it is a regular file that can be opened for reading."""
    return "\0" not in file and os.path.isfile(file) and os.access(file, os.R_OK)


def _has_reader(pipe: str) -> bool:
    try:
        os.close(os.open(pipe, os.O_WRONLY | os.O_NONBLOCK))
    except OSError:
        return False
    return True
