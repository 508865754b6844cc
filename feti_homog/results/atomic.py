"""Files that appear complete or not at all, whenever their writer ends.

File and folder are synchronised: content and name are on the disk before the writer goes on.
"""

import contextlib
import os
import re
from collections.abc import Callable, Iterator
from pathlib import Path

from feti_homog.errors import FetiHomogError
from feti_homog.system.runtime import file_locks


def replace(path: Path, write: Callable[[Path], object]) -> Path:
    """Let `write` make a file beside `path`, which then takes its place in one step; returns `path`.

    Raises:
        FetiHomogError: the file cannot be written; an earlier file at `path` is untouched.
    """
    part = part_of(path)
    with write_errors(path):
        try:
            file_locks.files.add(part)
            write(part)
            commit(part, path)
        except BaseException:
            with contextlib.suppress(OSError):
                part.unlink(missing_ok=True)
            raise
        finally:
            file_locks.files.discard(part)
    return path


def replace_text(path: Path, text: str) -> Path:
    """Write a text file as `replace` does, with its errors."""
    return replace(path, lambda part: part.write_text(text, encoding="utf-8"))


def part_of(path: Path) -> Path:
    """Return the name of an unfinished file beside `path`, which no other process writes."""
    return path.with_name(f"{path.name}.{file_locks.tag()}.part")


def commit(part: Path, path: Path) -> None:
    """Give the finished file `part` the name `path`, in one step that lasts.  Raises OSError."""
    _synchronise(part)
    rename(part, path)


def append(path: Path, start: int, content: bytes, lasts: bool) -> None:
    """Write bytes from byte `start` of a file on, in place of all that follows; if it `lasts`, they are on the disk.

    A reader must recognize unfinished bytes at the end of the file: the writer may be killed.

    Raises:
        FetiHomogError: the file cannot be written.
    """
    with write_errors(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("r+b" if start else "wb") as stream:
            stream.seek(start)
            stream.truncate()
            stream.write(content)
            stream.flush()
            if lasts:
                os.fsync(stream.fileno())


def rename(old: Path, new: Path) -> None:
    """Rename a file or folder within its folder, in one step that lasts.  Raises OSError."""
    os.replace(old, new)
    with contextlib.suppress(OSError):  # not every file system synchronises folders
        _synchronise(new.parent)


def remove_unfinished(folder: Path, names: re.Pattern[str], alone: bool = True) -> None:
    """Remove unfinished files from killed writers, on any machine if this process may write there `alone`."""
    part = re.compile(rf"({names.pattern})\.(?P<tag>.+\.\d+)\.part")
    for path in folder.glob("*.part"):
        if (match := part.fullmatch(path.name)) and (alone or file_locks.has_ended(match["tag"])):
            with contextlib.suppress(OSError):
                path.unlink()


def write_errors(path: Path) -> contextlib.AbstractContextManager[None]:
    """Report failed writes in the block as FetiHomogError about `path`, RuntimeErrors of HDF5 too."""
    return file_errors("write", path)


@contextlib.contextmanager
def file_errors(verb: str, path: Path) -> Iterator[None]:
    """Report failures in the block as FetiHomogError "cannot `verb` `path`", RuntimeErrors of HDF5 too."""
    try:
        yield
    except (OSError, RuntimeError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else error
        raise FetiHomogError(f"cannot {verb} {path}: {reason}") from error


def _synchronise(path: Path) -> None:
    """Wait until a file, or the names in a folder, are on the disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
