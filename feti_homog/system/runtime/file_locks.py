"""Lock files between processes on machines that share a file system, and remove files when a process ends.

The system releases a lock whenever its process ends, even by SIGKILL.
"""

import contextlib
import errno
import fcntl
import os
import re
import socket
import time
from pathlib import Path
from typing import Self

from feti_homog.errors import FetiHomogError

# Seconds for which a lock is tried: a process that only asks for the holder takes the lock for a moment.
LOCK_TIMEOUT_S = 0.2
# Errors of the system if another process has the lock, and if the file system has no locks.
HELD = (errno.EAGAIN, errno.EACCES)
UNSUPPORTED = (errno.ENOSYS, errno.ENOLCK, errno.EOPNOTSUPP)
TAG = re.compile(r"(?P<host>.+)\.(?P<process>\d+)\.(?P<began>\d+)")
# Files to remove at the end of this process: its lock files and unfinished files.
files: set[Path] = set()


class LockHeld(Exception):
    """Another process holds the lock; the text names the holder."""


class LocksUnsupported(FetiHomogError):
    """The file system has no locks."""


class Lock:
    """A lock on the file `path`, which the last holder removes; `shared` locks exclude only exclusive locks.

    `acquire` tries for `timeout` seconds.  A lock is also a context manager.
    """

    def __init__(self, path: Path, shared: bool = False, timeout: float = LOCK_TIMEOUT_S) -> None:
        self.path, self.shared, self.timeout = path, shared, timeout
        self._file = -1

    def acquire(self) -> None:
        """Take the lock.

        Raises:
            LockHeld: another process has the lock.
            LocksUnsupported: the file system has no locks.
            FetiHomogError: the file cannot be created or locked.
        """
        self._take()
        while not self._is_at_path():  # the last holder removed the file after it was opened here
            self._close()
            self._take()
        if not self.shared:
            files.add(self.path)

    def release(self) -> None:
        """Release the lock, if it is held, and remove its file unless other processes share it."""
        with contextlib.suppress(OSError):  # other processes share the lock
            if self._file >= 0:
                fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                if self._is_at_path():
                    self.path.unlink()
        files.discard(self.path)
        self._close()

    def __enter__(self) -> Self:
        self.acquire()
        return self

    def __exit__(self, *error: object) -> None:
        self.release()

    def _take(self) -> None:
        deadline = time.monotonic() + self.timeout
        kind = fcntl.LOCK_SH if self.shared else fcntl.LOCK_EX
        try:
            self._file = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o666)
            while not _is_taken(self._file, kind):
                if time.monotonic() > deadline:
                    raise LockHeld(_written(self._file))
                time.sleep(0.01)
            if not self.shared:
                with contextlib.suppress(OSError):  # on a full disk the lock holds without the name of its holder
                    os.truncate(self._file, 0)
                    os.pwrite(self._file, this_process().encode(), 0)
        except LockHeld:
            self._close()
            raise
        except OSError as error:
            self._close()
            failure = LocksUnsupported if error.errno in UNSUPPORTED else FetiHomogError
            raise failure(f"cannot lock {self.path}: {error.strerror}") from error

    def _close(self) -> None:
        if self._file >= 0:
            os.close(self._file)
            self._file = -1

    def _is_at_path(self) -> bool:
        try:
            return os.path.samestat(os.fstat(self._file), self.path.stat())
        except FileNotFoundError:
            return False


def _is_taken(file: int, kind: int) -> bool:
    """Lock an open file with flock's `kind`; return True, or False if another process has the lock.  Raises OSError."""
    try:
        fcntl.flock(file, kind | fcntl.LOCK_NB)
    except OSError as error:
        if error.errno not in HELD:
            raise
        return False
    return True


def holder(path: Path) -> str | None:
    """Return the `this_process` name of the holder of an exclusive lock on `path`; None without a lock or access."""
    with contextlib.suppress(OSError), path.open("rb+") as stream:
        return None if _is_taken(stream.fileno(), fcntl.LOCK_SH) else _written(stream.fileno())
    return None


def this_process() -> str:
    """Return the name of this process in lock files: machine, process number, and SLURM or PBS job if any."""
    names = [socket.gethostname(), f"process {os.getpid()}"]
    job = os.environ.get("SLURM_JOB_ID") or os.environ.get("PBS_JOBID")
    return ", ".join([*names, f"job {job}"] if job else names)


def _written(file: int) -> str:
    return os.pread(file, 200, 0).decode(errors="replace") or "another process"


def tag() -> str:
    """Return a name for the files of this process, unique over all machines and all time."""
    return f"{socket.gethostname()}.{os.getpid()}.{_began(os.getpid())}"


def has_ended(name: str) -> bool:
    """Return whether `name` is the `tag` of an ended process on this machine; False for other machines and names."""
    match = TAG.fullmatch(name)
    return match is not None and match["host"] == socket.gethostname() and match["began"] != _began(match["process"])


def remove_files() -> None:
    """Remove the lock files and unfinished files of this process, the `files`; failures are ignored."""
    for path in tuple(files):
        with contextlib.suppress(OSError):
            path.unlink()


def _began(process: int | str) -> str:
    """Return the start time of a process in clock ticks since boot, by proc(5); empty if there is no process."""
    try:
        return Path(f"/proc/{process}/stat").read_text(errors="replace").rpartition(")")[2].split()[19]
    except OSError:
        return ""
