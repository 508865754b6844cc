"""Files that are there whole or not at all, whoever reads and whenever the writer ends."""

from __future__ import annotations

import contextlib
import os
import socket
from collections.abc import Callable
from pathlib import Path

from feti_homog.errors import FetiHomogError


def replace(path: Path, write: Callable[[Path], object]) -> Path:
    """Let `write` make a file beside `path`, which then takes its place in one step; returns `path`.

    Raises:
        FetiHomogError: the file cannot be written; what was at `path` is untouched.
    """
    part = path.with_name(f"{path.name}.{socket.gethostname()}.{os.getpid()}.part")
    try:
        write(part)
        with part.open("rb") as stream:
            os.fsync(stream.fileno())
        os.replace(part, path)
    except (OSError, RuntimeError) as error:  # the latter from HDF5
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)
        reason = error.strerror if isinstance(error, OSError) and error.strerror else error
        raise FetiHomogError(f"cannot write {path}: {reason}") from error
    return path


def replace_text(path: Path, text: str) -> Path:
    """The same with a text.  Raises FetiHomogError as `replace` does."""
    return replace(path, lambda part: part.write_text(text, encoding="utf-8"))
