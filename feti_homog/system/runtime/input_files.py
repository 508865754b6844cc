"""Files that users name: regular ones, of bounded size; files that wait for a writer or have no end are refused."""

import errno
import os
import stat
from pathlib import Path
from typing import BinaryIO

from feti_homog.errors import CaseError, FetiHomogError

MOST_BYTES = 1 << 30


def opened(path: Path, pipes: bool = False) -> BinaryIO:
    """Open a file for reading.

    With `pipes` it may be anything but a folder, as in a shell's `<(...)`; a device may never end.

    Raises:
        OSError: it cannot be opened, or is no regular file.
    """
    descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC | (0 if pipes else os.O_NONBLOCK))
    kind = os.fstat(descriptor).st_mode
    if stat.S_ISREG(kind) or (pipes and not stat.S_ISDIR(kind)):
        return open(descriptor, "rb")
    os.close(descriptor)
    if stat.S_ISDIR(kind):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
    raise OSError(errno.EINVAL, "it is a pipe" if stat.S_ISFIFO(kind) else "it is no file but a device")


def read(path: Path, most: int = MOST_BYTES, pipes: bool = False) -> bytes:
    """Return the content of a file opened by `opened`.

    Raises:
        OSError: as `opened`; also for a file of more than `most` bytes.
    """
    with opened(path, pipes) as stream:
        size = os.fstat(stream.fileno()).st_size  # 0 of pipes
        content = b"" if size > most else stream.read((size or most) + 1)
    if size > most or len(content) > most:
        raise OSError(errno.EFBIG, f"it has more than {most >> 20} MiB")
    return content


def unreadable(path: Path, error: OSError) -> FetiHomogError:
    """Return the error to raise for a file of results: bad input where it is missing or no file, else a failure."""
    kind = FetiHomogError if isinstance(error, PermissionError) else CaseError
    return kind(f"cannot read {path}: {error.strerror or error}")
