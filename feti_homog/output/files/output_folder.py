"""The folder that results go to, which one run at a time writes to."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from feti_homog.common.file_locks import LockHeld, TemporaryLock, holder
from feti_homog.common.mpi_errors import on_root
from feti_homog.errors import CaseError
from feti_homog.output.files import atomic

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

LOCK = "result.lock"


def usable(directory: Path) -> None:
    """Check that `directory` is one, or can be made, can be written to, and that no run writes to it just now.

    Nothing is made yet.

    Raises:
        CaseError: it cannot be used.
    """
    there = next(p for p in (directory.absolute(), *directory.absolute().parents) if p.exists())
    if not there.is_dir():
        raise CaseError(f"--out {directory}: expected a folder, but {there} is a file")
    if not os.access(there, os.W_OK | os.X_OK):
        raise CaseError(f"--out {directory}: expected a folder that can be written to; {there} cannot")
    if (who := holder(directory / LOCK)) is not None:
        raise _busy(directory, who)


@contextmanager
def held(directory: Path, comm: Intracomm) -> Iterator[None]:
    """The folder, made with its parents, is this run's alone while the block lasts.  Collective.

    What earlier runs left unfinished in it is removed.

    Raises:
        CaseError: it cannot be made, or another run has it.
    """
    lock = TemporaryLock(directory / LOCK)
    on_root(comm, _hold, lock, directory)
    try:
        yield
    finally:
        lock.release()


def _hold(lock: TemporaryLock, directory: Path) -> None:
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise CaseError(f"--out {directory}: cannot be made: {error.strerror}") from error
    try:
        lock.acquire()
    except LockHeld as held:
        raise _busy(directory, str(held)) from held
    atomic.remove_unfinished(directory)


def _busy(directory: Path, who: str) -> CaseError:
    return CaseError(f"--out {directory}: another run writes its results there: {who}; choose another folder or wait")
