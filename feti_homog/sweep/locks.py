"""Locks between processes, on one machine or on several that share a file system.

The system takes a lock back when its process ends, however that ends: none is left behind by a kill.
"""

from __future__ import annotations

import errno
import fcntl
import os
import socket
import time
from pathlib import Path
from types import TracebackType

from feti_homog.errors import FetiHomogError

LOCK_TIMEOUT_S = 0.2  # who only looks whether a lock is held holds it for a moment


class LockHeld(Exception):
    """Somebody else holds the lock; the text says who."""


class Lock:
    """A lock on the file `path`, which stays behind; `shared` ones exclude the others only.

    It is tried for during `timeout` seconds.  As a context manager it is held while the block lasts.
    """

    def __init__(self, path: Path, shared: bool = False, timeout: float = LOCK_TIMEOUT_S) -> None:
        self.path, self.shared, self.timeout = path, shared, timeout
        self._file = -1

    def acquire(self) -> None:
        """Take the lock.

        Raises:
            LockHeld: somebody else has it.
            FetiHomogError: the file cannot be written or locked.
        """
        try:
            self._file = os.open(self.path, os.O_RDWR | os.O_CREAT, 0o666)
            self._try_until(time.monotonic() + self.timeout)
            if not self.shared:
                os.truncate(self._file, 0)
                os.pwrite(self._file, f"{socket.gethostname()}, process {os.getpid()}".encode(), 0)
        except OSError as error:
            self.release()
            raise FetiHomogError(f"cannot lock {self.path}: {error.strerror}") from error
        except LockHeld:
            self.release()
            raise

    def release(self) -> None:
        """Give the lock back, if it is held."""
        if self._file >= 0:
            os.close(self._file)
            self._file = -1

    def __enter__(self) -> Lock:
        self.acquire()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.release()

    def _try_until(self, deadline: float) -> None:
        kind = fcntl.LOCK_SH if self.shared else fcntl.LOCK_EX
        while True:
            try:
                return fcntl.flock(self._file, kind | fcntl.LOCK_NB)
            except OSError as error:
                if error.errno not in (errno.EAGAIN, errno.EACCES):
                    raise
                if time.monotonic() > deadline:
                    raise LockHeld(self._holder()) from error
            time.sleep(0.01)

    def _holder(self) -> str:
        return os.pread(self._file, 200, 0).decode(errors="replace") or "another process"


def is_locked(path: Path) -> bool:
    """Whether somebody holds the lock exclusively just now."""
    try:
        file = os.open(path, os.O_RDWR)
    except OSError:
        return False
    try:
        fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        return False
    except OSError:
        return True
    finally:
        os.close(file)
