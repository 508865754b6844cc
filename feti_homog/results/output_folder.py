"""The folder that results go to, which one run at a time writes to."""

from __future__ import annotations

import contextlib
import os
import re
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from feti_homog.runtime.file_locks import LockHeld, LocksUnsupported, TemporaryLock, holder
from feti_homog.parallel.mpi_errors import on_root
from feti_homog.materials.voigt import SPATIAL_STRAINS
from feti_homog.errors import CaseError, FetiHomogError
from feti_homog.results import atomic

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

LOCK = "result.lock"
LONGEST = "case_minus_temperature.png"  # of a run's files the one of the longest name
# The files of a result, those of all analyses and of what `plot` draws.
RESULT_FILE = re.compile(
    r"report\.html|events\.log|result\.(json|h5|xdmf)|interface\.xdmf"
    r"|(angle|path|load|envelope)\.csv|(cell|interface|load|envelope|(angle|path)(_states)?)\.png|path\.gif"
    rf"|case_(minus_)?({'|'.join(SPATIAL_STRAINS)}|temperature)\.png|state_\d+\.png"
)


def usable(directory: Path) -> None:
    """Check that `directory` is one, or can be made, can be written to, and that no run writes to it just now.

    Nothing is made yet.

    Raises:
        CaseError: it cannot be used.
    """
    try:
        with contextlib.suppress(FileNotFoundError, NotADirectoryError):
            os.stat(atomic.part_of(directory / LONGEST))  # is such a name too long?
        there = next(p for p in (directory.absolute(), *directory.absolute().parents) if os.path.lexists(p))
        if there.is_symlink() and not there.exists():
            raise CaseError(f"--out {directory}: expected a folder, but {there} is a link that leads nowhere")
        if not there.is_dir():
            raise CaseError(f"--out {directory}: expected a folder, but {there} is a file")
        if not os.access(there, os.W_OK | os.X_OK):
            raise CaseError(f"--out {directory}: expected a folder that can be written to; {there} cannot")
    except OSError as error:
        raise CaseError(f"--out {directory}: cannot be used: {error.strerror}") from error
    if (who := holder(directory / LOCK)) is not None:
        raise _busy(directory, who)


@contextmanager
def held(directory: Path, comm: Intracomm, say: Callable[[str], object]) -> Iterator[None]:
    """The folder, made with its parents, is this run's alone while the block lasts.  Collective.

    What earlier runs left unfinished in it is removed; so are, at the end, the folders made here that are empty.
    Where the file system has no locks, `say` is told so and the run goes on without one.

    Raises:
        CaseError: it cannot be made, or another run has it.
    """
    lock = TemporaryLock(directory / LOCK)
    made, warning = on_root(comm, _hold, lock, directory)
    if warning:
        say(f"warning: {warning}")
    try:
        yield
    finally:
        lock.release()
        if comm.rank == 0:
            _remove_empty(made)
    # No rank goes on while rank 0's lock is still to be seen; after an error of one rank the others may not come.
    comm.Barrier()


def remove_other_results(directory: Path, written: Collection[str]) -> None:
    """Remove what an earlier run left of the files of a result but for those named `written`.  Call on one rank."""
    for path in directory.iterdir():
        if RESULT_FILE.fullmatch(path.name) and path.name not in written and not path.is_dir():
            with contextlib.suppress(OSError):
                path.unlink()


def _hold(lock: TemporaryLock, directory: Path) -> tuple[list[Path], str]:
    """Make and lock the folder; returns the folders made, the innermost first, and a warning if it is not locked."""
    made = [path for path in (directory, *directory.parents) if not path.exists()]
    try:
        directory.mkdir(parents=True, exist_ok=True)
        lock.acquire()
    except OSError as error:
        _remove_empty(made)
        raise CaseError(f"--out {directory}: cannot be made: {error.strerror}") from error
    except LockHeld as held:
        raise _busy(directory, str(held)) from held
    except LocksUnsupported as error:
        lock.path.unlink(missing_ok=True)
        return made, f"{error}; nothing keeps another run from writing to the same folder"
    except FetiHomogError:
        _remove_empty(made)
        raise
    atomic.remove_unfinished(directory, RESULT_FILE)
    return made, ""


def _remove_empty(folders: list[Path]) -> None:
    """Remove these folders, each in the next, as far as they are empty."""
    with contextlib.suppress(OSError):
        for folder in folders:
            folder.rmdir()


def _busy(directory: Path, who: str) -> CaseError:
    return CaseError(f"--out {directory}: another run writes its results there: {who}; choose another folder or wait")
