"""The result folder and its events.log: one run at a time writes there, and no foreign file is replaced.

A run recognizes its own files by content, not by a marker: somebody may later put a file with one of their names there.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

from feti_homog.errors import CaseError, FetiHomogError
from feti_homog.materials import voigt
from feti_homog.results import atomic, checkpoints, field_file, result_json
from feti_homog.results.field_layout import PROGRAM
from feti_homog.system.parallel import mpi_errors
from feti_homog.system.runtime import file_locks, input_files
from feti_homog.version import __version__

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

LOCK = "result.lock"
LOG = "events.log"  # a line an event of a path, there to be followed while the path goes on
LOG_HEADER = "# feti-homog: events"  # the beginning of the first line, by which a log is known as one of this program
LONGEST = "case_minus_temperature.png"  # of a run's files the one of the longest name
# The files of a result, those of all analyses and of what `plot` and `fields` make.
RESULT_FILE = re.compile(
    r"report\.html|events\.log|result\.(json|h5|xdmf)|interface\.xdmf"
    r"|(angle|path|load|envelope)\.csv|path\.gif"
    r"|(cell|partition|mesh_error|sensitivities|energy|interface|load|envelope|(angle|path)(_states)?)\.png"
    r"|(cell|interface)(_\d{4,}\.vtu|\.pvd|\.vtkhdf)"
    rf"|case_(minus_)?({'|'.join(voigt.SPATIAL_STRAINS)}|temperature)\.png|state_\d+\.png"
)
# Of these those that show that a run has written to the folder.
SIGNS = (result_json.NAME, field_file.NAME, LOG, LOCK)
HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"


def usable(directory: Path) -> None:
    """Check that `directory` is a folder or can be made, is writable, and that no run writes there now.

    Makes nothing.

    Raises:
        CaseError: it cannot be used.
    """
    try:
        with contextlib.suppress(FileNotFoundError, NotADirectoryError):
            os.stat(atomic.part_of(directory / LONGEST))  # is such a name too long?
        existing = next(p for p in (directory.absolute(), *directory.absolute().parents) if os.path.lexists(p))
        if existing.is_symlink() and not existing.exists():
            raise CaseError(f"--out {directory}: expected a folder, but {existing} is a link that leads nowhere")
        if not existing.is_dir():
            raise CaseError(f"--out {directory}: expected a folder, but {existing} is a file")
        if not os.access(existing, os.W_OK | os.X_OK):
            raise CaseError(f"--out {directory}: expected a folder that can be written to; {existing} cannot")
    except OSError as error:
        raise CaseError(f"--out {directory}: cannot be used: {error.strerror}") from error
    if (directory / LOCK).is_symlink():  # whose file elsewhere would get the name of the holder
        raise CaseError(f"--out {directory}: {LOCK} is a link there; move it away or choose another folder")
    if (who := file_locks.holder(directory / LOCK)) is not None:
        raise _busy(directory, who)


def refuse_files_of_others(directory: Path) -> None:
    """Check that a run may write all its files to `directory`, and replace existing ones.  Call on one rank.

    Raises:
        CaseError: a folder has the name of a file, a file the name of a folder, or no run wrote a file of that name.
    """
    if not directory.is_dir():
        return
    try:
        paths = [p for p in sorted(directory.iterdir()) if p.name in SIGNS or RESULT_FILE.fullmatch(p.name)]
        for path in paths:
            kind = "a folder there" if path.is_dir() else "" if path.exists() else "a link there that leads nowhere"
            if kind:
                raise CaseError(f"--out {directory}: {path.name} is {kind}, and a run writes a file of that name")
        checkpoints.refuse_others(directory)
        signs = [path for path in paths if path.name in SIGNS]
        # Without any sign of a run, all files that are not empty are foreign.
        others = [path for path in signs or paths if path.stat().st_size and not (signs and _is_own(path))]
    except OSError as error:
        raise CaseError(f"--out {directory}: its files cannot be read: {error.strerror}") from error
    if others:
        raise foreign(directory, others[0].name, "run")


def foreign(directory: Path, name: str, kind: str) -> CaseError:
    """Return the error for a file of others under a name that a run or a study writes."""
    return CaseError(
        f"--out {directory}: no {kind} of this program wrote {name}, and this one would replace it; "
        "move it away or choose another folder"
    )


def _is_own(path: Path) -> bool:
    """Return whether a run wrote this result.json, of whatever version, result.h5 or events.log."""
    if path.name == result_json.NAME:
        try:
            document = json.loads(input_files.read(path))
        except ValueError:
            return False
        return isinstance(document, dict) and {"version", "case", "solver"} <= document.keys()
    with input_files.opened(path) as stream:
        head = stream.read(1 << 20)  # which has the attributes of result.h5
    if path.name == field_file.NAME:
        return head.startswith(HDF5_SIGNATURE) and PROGRAM.encode() in head
    return path.name != LOG or head.startswith(LOG_HEADER.encode())


@contextmanager
def held(directory: Path, comm: Intracomm, say: Callable[[str], object]) -> Iterator[None]:
    """Make the folder with its parents and lock it for this run while the block lasts.  Collective.

    Removes unfinished files from earlier runs and, at the end, new folders that are empty.  On a file system without
    locks `say` gets a warning and the run goes on without one.

    Raises:
        CaseError: it cannot be made, or another run has it.
    """
    lock = file_locks.Lock(directory / LOCK)
    made, warning = mpi_errors.on_root(comm, _hold, lock, directory)
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
    """Remove result files from an earlier run, except for names in `written`.  Call on one rank."""
    for path in directory.iterdir():
        if RESULT_FILE.fullmatch(path.name) and path.name not in written and not path.is_dir():
            with contextlib.suppress(OSError):
                path.unlink()


def write_product(path: Path, text: str) -> Path:
    """Write the product of a command, a card or a fibre table, to a file; returns its path.

    A link stays; the file that it leads to is written.

    Raises:
        CaseError: `path` is a folder, a device or a pipe, in no folder, or a file of a result.
        FetiHomogError: it cannot be written; nothing is left half-written.
    """
    if path.exists() and not path.is_file():  # a device would be replaced, not written to
        kind = "a folder" if path.is_dir() else "a device or a pipe"
        raise CaseError(f"--out {path}: expected a file, but it is {kind}")
    target = Path(os.path.realpath(path))
    if not target.parent.is_dir():
        raise CaseError(f"--out {path}: expected a file in a folder that there is")
    if RESULT_FILE.fullmatch(path.name) or RESULT_FILE.fullmatch(target.name):
        raise CaseError(f"--out {path}: expected another name; results have files of that name")
    atomic.remove_unfinished(target.parent, re.compile(re.escape(target.name)), alone=False)
    atomic.replace_text(target, f"{text}\n")
    return path


def _hold(lock: file_locks.Lock, directory: Path) -> tuple[list[Path], str]:
    """Make and lock the folder; returns new folders, innermost first, and a warning if it has no lock."""
    made = [path for path in (directory, *directory.parents) if not path.exists()]
    try:
        directory.mkdir(parents=True, exist_ok=True)
        lock.acquire()
    except OSError as error:
        _remove_empty(made)
        raise CaseError(f"--out {directory}: cannot be made: {error.strerror}") from error
    except file_locks.LockHeld as held:
        raise _busy(directory, str(held)) from held
    except file_locks.LocksUnsupported as error:
        lock.path.unlink(missing_ok=True)
        return made, f"{error}; nothing keeps another run from writing to the same folder"
    except FetiHomogError:
        _remove_empty(made)
        raise
    atomic.remove_unfinished(directory, RESULT_FILE)
    return made, ""


def _remove_empty(folders: list[Path]) -> None:
    """Remove nested folders, innermost first, as far as they are empty."""
    with contextlib.suppress(OSError):
        for folder in folders:
            folder.rmdir()


def _busy(directory: Path, who: str) -> CaseError:
    return CaseError(f"--out {directory}: another run writes its results there: {who}; choose another folder or wait")


class EventLog:
    """The event log in `directory`, written by rank 0; its first line replaces an earlier log.

    If it cannot be written `say` gets one warning, and the path goes on without it: the log holds no results.
    """

    def __init__(self, directory: Path, comm: Intracomm, title: str, say: Callable[[str], object]) -> None:
        self.path, self._title, self._say = directory / LOG, title, say
        self._wanted = comm.rank == 0
        self._stream: TextIO | None = None

    def write(self, line: str) -> None:
        """Add a line."""
        if not self._wanted:
            return
        try:
            with atomic.write_errors(self.path):
                if self._stream is None:
                    self._stream = self.path.open("w", encoding="utf-8", buffering=1)  # whole lines
                    print(f"{LOG_HEADER} of {self._title}, version {__version__}", file=self._stream)
                print(line.strip(), file=self._stream)
        except FetiHomogError as error:
            self._say(f"warning: {error}; the path goes on without it")
            self.close()

    def close(self) -> None:
        """End the log."""
        self._wanted = False
        if self._stream is not None:
            with contextlib.suppress(OSError):  # every line was written when it was given
                self._stream.close()
