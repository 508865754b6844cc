"""Write files that appear complete or not at all, even if the writer is killed; only `append` extends a file in place.

The writer waits until both the content and the name of a file are on the disk.
"""

import contextlib
import errno
import os
import re
from collections.abc import Callable, Iterator
from pathlib import Path

from feti_homog.errors import FetiHomogError
from feti_homog.system.runtime import file_locks


def replace(path: Path, write: Callable[[Path], object]) -> Path:
    """Replace the file `path` by the output of `write`, in one step; return `path`.

    `write` gets the name of an unfinished file in the same folder.  After any exception this file is removed, and an
    earlier file at `path` is untouched.  Raises FetiHomogError if the file cannot be written.
    """
    part = part_of(path)
    with file_errors("write", path):
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
    """Replace the content of a file by a string in UTF-8, and return `path`.  Raises like `replace`."""
    return replace(path, lambda part: part.write_text(text, encoding="utf-8"))


def part_of(path: Path) -> Path:
    """Return a name for the unfinished file that becomes `path`; no other process uses the name."""
    return path.with_name(f"{path.name}.{file_locks.tag()}.part")


def commit(part: Path, path: Path) -> None:
    """Rename the finished file `part` to `path`, once its content is on the disk.  Raises OSError."""
    _synchronise(part)
    rename(part, path)


def append(path: Path, start: int, content: bytes, lasts: bool) -> None:
    """Write `content` at byte `start` of a file, and drop all former bytes from there on.

    At position 0 the function creates the file and its folder.  With `lasts`, it waits until the bytes are on the disk.
    A killed writer leaves unfinished bytes at the file end, which a reader must recognize.  Raises FetiHomogError if
    the file cannot be written.
    """
    with file_errors("write", path):
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("r+b" if start else "wb") as stream:
            stream.seek(start)
            stream.truncate()
            stream.write(content)
            stream.flush()
            if lasts:
                os.fsync(stream.fileno())


def rename(old: Path, new: Path) -> None:
    """Rename a file or folder, and wait until the name is on the disk, if possible.  Raises OSError."""
    os.replace(old, new)
    with contextlib.suppress(OSError):  # not every file system synchronises folders
        _synchronise(new.parent)


def remove_unfinished(folder: Path, names: re.Pattern[str], alone: bool = True) -> None:
    """Remove unfinished files from a folder, as far as possible, if their final names match `names`.

    If `alone` is False, other processes may write there, and files of running writers stay.
    """
    part = re.compile(rf"({names.pattern})\.(?P<tag>.+\.\d+)\.part")
    for path in folder.glob("*.part"):
        if (match := part.fullmatch(path.name)) and (alone or file_locks.has_ended(match["tag"])):
            with contextlib.suppress(OSError):
                path.unlink()


@contextlib.contextmanager
def file_errors(verb: str, path: Path) -> Iterator[None]:
    """Context manager: turn OSError, and RuntimeError of HDF5, into FetiHomogError "cannot VERB PATH: REASON".

    If a write fails without a system message, and the disk is full, the reason is "No space left on device".
    """
    try:
        yield
    except (OSError, RuntimeError) as error:
        reason: object = error.strerror if isinstance(error, OSError) and error.strerror else error
        with contextlib.suppress(OSError):
            if reason is error and verb == "write" and os.statvfs(path.parent).f_bavail == 0:
                reason = os.strerror(errno.ENOSPC)
        raise FetiHomogError(f"cannot {verb} {path}: {reason}") from error


def _synchronise(path: Path) -> None:
    """Wait until a file, or the list of names in a folder, is on the disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
