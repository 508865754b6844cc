"""Lock the result folder, and check its files.

One run at a time writes to the folder, and replaces no foreign file.  A run recognizes result files by content, not by
a marker in the folder: a user may later add a foreign file with such a name.
"""

import contextlib
import json
import os
import re
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from shlex import quote
from typing import Any

from feti_homog.case import Case
from feti_homog.errors import CaseError, FetiHomogError
from feti_homog.materials import voigt
from feti_homog.results import atomic, field_file, result_json
from feti_homog.results.field_layout import PROGRAM
from feti_homog.schema import wording
from feti_homog.system.parallel import mpi_errors
from feti_homog.system.runtime import file_locks, input_files
from feti_homog.typing import Intracomm

LOCK = "result.lock"
LONGEST = "case_minus_temperature.png"  # longest file name of a run
# All files of a result, for all analyses and the commands `plot` and `fields`.
RESULT_FILE = re.compile(
    r"report\.html|events\.log|result\.(json|h5|xdmf)|interface\.xdmf"
    r"|(angle|path|load|envelope)\.csv|path\.gif"
    r"|(cell|partition|mesh_error|sensitivities|energy|interface|load|envelope|(angle|path)(_states)?)\.(png|pdf|svg)"
    r"|(cell|interface)(_\d{4,}\.vtu|\.pvd|\.vtkhdf)"
    rf"|case_(minus_)?({'|'.join(voigt.SPATIAL_STRAINS)}|temperature|dT_dx[12])\.(png|pdf|svg)"
    r"|state_\d+\.(png|pdf|svg)"
)
# Files that show that a run has written to the folder.
SIGNS = (result_json.NAME, field_file.NAME, result_json.LOG, LOCK)
STUDIES = ("sweep.json", "fit.json", "uncertainty.json")  # documents of studies in their folders
HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"


def usable(directory: Path) -> None:
    """Check that a run can use the folder `directory`, without creating it.

    The folder, or its nearest existing parent, must be writable, and no other run may use it.  Raises CaseError.
    """
    try:
        with contextlib.suppress(FileNotFoundError, NotADirectoryError):
            os.stat(atomic.part_of(directory / LONGEST))  # raises an error if the name is too long
        existing = next(p for p in (directory.absolute(), *directory.absolute().parents) if os.path.lexists(p))
        if not existing.is_dir():
            kind = "a file" if existing.exists() else "a link that leads nowhere"
            raise CaseError(f"--out {directory}: expected a folder, but {existing} is {kind}")
        if not os.access(existing, os.W_OK | os.X_OK):
            raise CaseError(f"--out {directory}: expected a folder that can be written to; {existing} cannot")
    except OSError as error:
        raise CaseError(f"--out {directory}: cannot be used: {error.strerror}") from error
    if (directory / LOCK).is_symlink():  # the lock would write to the target of the link
        raise CaseError(f"--out {directory}: {LOCK} is a link there; move it away or choose another folder")
    if (who := file_locks.holder(directory / LOCK)) is not None:
        raise _busy(directory, who)


def refuse_files_of_others(directory: Path) -> None:
    """Check that a run may replace the files in `directory`.  Call on one rank.

    Raises CaseError if a folder, a broken link or a foreign file has the name of a result file, or the folder is
    unreadable.
    """
    if not directory.is_dir():
        return
    try:
        paths = [p for p in sorted(directory.iterdir()) if p.name in SIGNS or RESULT_FILE.fullmatch(p.name)]
        for path in paths:
            if path.is_dir() or not path.exists():
                kind = "a folder there" if path.is_dir() else "a link there that leads nowhere"
                raise CaseError(f"--out {directory}: {path.name} is {kind}, and a run writes a file of that name")
        if any(path.name.startswith("checkpoint") for path in directory.iterdir()):
            from feti_homog.results import checkpoints  # only paths have checkpoints

            checkpoints.refuse_others(directory)
        signs = [path for path in paths if path.name in SIGNS]
        # Without any sign of a run, all files that are not empty are foreign.
        foreign_files = [p for p in signs or paths if p.stat().st_size and (not signs or not _is_own(p))]
    except OSError as error:
        raise CaseError(f"--out {directory}: its files cannot be read: {error.strerror}") from error
    if foreign_files:
        raise foreign(directory, foreign_files[0].name, "run")


def replaced(directory: Path, case: Case) -> str:
    """Return a warning if a run replaces an unreadable result, or one of another case; else "".  Call on one rank.

    Raises CaseError if the folder has events of this case, from which a run can go on.
    """
    path, has_result = directory / "checkpoint/events", os.path.lexists(directory / result_json.NAME)
    if not path.is_file() and not has_result:
        return ""
    from feti_homog.results import checkpoints  # only paths have checkpoints

    are_own, change = list[bool](), ""  # are_own: of the signature, then of each event
    try:
        signature = b"case %s," % case.digest(False).encode()  # begins the first record
        if path.is_file():
            are_own = [content.startswith(signature) for _, content in checkpoints.records(path)]
        if len(are_own) > 1 or has_result:
            stored = latest(directory)
            title = f"{wording.toml_value(stored['case']['name'])} ({stored['date']}, {stored['status']})"
            change = "" if stored["digest"] == case.digest() else f"replaces the result of case {title}"
    except (FetiHomogError, LookupError, TypeError) as error:
        change = f"replaces a result that cannot be read: {error}"
    if len(are_own) > 1 and are_own[0]:
        way = f"--resume goes on from them; remove {path.parent} to start again"
        raise CaseError(f"--out {directory}: it holds {len(are_own) - 1} events of this path: {way}")
    return f"warning: {directory}: this run {change}" if change else ""


def foreign(directory: Path, name: str, kind: str) -> CaseError:
    """Construct the CaseError for a foreign file with the name of a result.  `kind` names the run, such as "sweep"."""
    fault = f"no {kind} of this program wrote {name}, or it is damaged, and this one would replace it"
    return CaseError(f"--out {directory}: {fault}; move it away or choose another folder")


def _is_own(path: Path) -> bool:
    """Return whether some version of the program wrote result.json, result.h5 or events.log; True for other names."""
    if path.name == result_json.NAME:
        try:
            document = json.loads(input_files.read(path))
        except (ValueError, RecursionError):
            return False
        return isinstance(document, dict) and {"version", "case", "solver"} <= document.keys()
    with input_files.opened(path) as stream:
        head = stream.read(1 << 20)  # contains the attributes of result.h5
    if path.name == field_file.NAME:
        return head.startswith(HDF5_SIGNATURE) and PROGRAM.encode() in head
    return path.name != result_json.LOG or head.startswith(result_json.LOG_HEADER.encode())


def latest(directory: Path) -> dict[str, Any]:
    """Return the document of result.json or, for an unfinished path, of the checkpoint.  Call on one rank.

    The checkpoint counts if it has more points, or result.json is missing or of another case; then the entries
    `unfinished` and `status` give the number of points and the load.  Raises CaseError for a missing or damaged file,
    or unreadable events, FetiHomogError for a result.json without read permission.
    """
    from feti_homog.results import checkpoints  # only paths have checkpoints

    path = directory / checkpoints.FOLDER / checkpoints.NAME
    contents = [content for _, content in checkpoints.records(path)] if path.is_file() else []
    signature, events = (contents[0], contents[1:]) if contents else (b"", [])
    stored = result_json.read(directory) if not events or os.path.lexists(directory / result_json.NAME) else {}
    try:
        opening = result_json.loads(signature.decode().partition("\n")[2] or "{}")
        if not events or (stored.get("digest") == opening["digest"] and len(stored.get("path", ())) >= len(events)):
            return stored
        points = [result_json.loads(str(checkpoints.unpacked(event)["point"])) for event in events]
        opening["solver"]["iterations"] = [point["iterations"] for point in points]
        place = f"unfinished, {len(points)} points up to load {max(point['load_factor'] for point in points):.4f}"
        result_json.text_of({"path": points})  # refuses numbers that are not finite
    except (FetiHomogError, LookupError, TypeError, ValueError) as error:
        raise CaseError(f"{path} is damaged: {error}") from error
    return opening | {"path": points, "status": place, "unfinished": place}


def result_folder(directory: Path) -> Path:
    """Return `directory`, the folder of a result.  Raises CaseError for a file, a missing folder, or a study."""
    if not os.path.isdir(directory):
        fault = "expected the folder of a result, not a file" if os.path.exists(directory) else "no such folder"
        raise CaseError(f"{directory}: {fault}")
    names = [name for name in STUDIES if os.path.exists(directory / name)]
    if os.path.exists(directory / result_json.NAME) or not names:
        return directory
    if names == ["sweep.json"]:
        expected = f"expected the folder of a case, such as {directory / 'case-0001'}, not that of a sweep"
        way = f"`feti-homog collect {quote(str(directory))}` makes tables of all cases"
        raise CaseError(f"{directory}: {expected}; {way}")
    names += ["fit.png"] if "fit.json" in names else []
    raise CaseError(f"{directory} has a study: see {', '.join(names)}")


def refuse_begun(directory: Path) -> None:
    """Raise CaseError for the folder of a begun run that has no result.json yet.  Call on one rank.

    The run still works, or ended early; for a path, the message gives the number of points and the load.
    """
    is_begun = any(os.path.lexists(directory / name) for name in (LOCK, "checkpoint"))
    if not is_begun or os.path.lexists(directory / result_json.NAME):
        return
    place, resume, who = "unfinished, without a point", "", file_locks.holder(directory / LOCK)
    with contextlib.suppress(CaseError):  # no event yet, or an unreadable one, which the next run names
        place, resume = latest(directory)["unfinished"], " --resume"
    way = f"{who} goes on with it" if who else f"go on by `feti-homog run CASE --out {quote(str(directory))}{resume}`"
    raise CaseError(f"{directory}: the run is {place}; {way}")


@contextmanager
def held(directory: Path, comm: Intracomm, say: Callable[[str], object]) -> Iterator[None]:
    """Context manager: create the result folder, and lock the folder during a block.  Collective.

    Removes unfinished files from earlier runs, and at the end new folders that stayed empty.  On a file system without
    locks, `say` gets a warning and the run continues without a lock.  Raises CaseError if the folder cannot be made, or
    another run has locked it; FetiHomogError if the lock file cannot be created or locked.
    """
    lock = file_locks.Lock(directory / LOCK)

    def hold() -> tuple[list[Path], str]:
        """Create and lock the folder.  Returns a list of new folders, innermost first, and a warning or ""."""
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

    made, warning = mpi_errors.on_root(comm, hold)
    if warning:
        say(f"warning: {warning}")
    try:
        yield
    finally:
        lock.release()
        if comm.rank == 0:
            _remove_empty(made)
    # No rank continues before rank 0 has released the lock. Not in `finally`: after an error of one rank, other ranks
    # may never reach the barrier.
    comm.Barrier()


def remove_other_results(directory: Path, written: Collection[str]) -> None:
    """Remove result files that are not in `written`; without the event log in it, also events.  Call on one rank.

    Files that cannot be removed stay.  Raises FetiHomogError if the checkpoint folder cannot be removed.
    """
    if result_json.LOG not in written and (directory / "checkpoint").is_dir():
        from feti_homog.results import checkpoints  # only paths have checkpoints

        checkpoints.remove(directory)
    for path in directory.iterdir():
        if RESULT_FILE.fullmatch(path.name) and path.name not in written and not path.is_dir():
            with contextlib.suppress(OSError):
                path.unlink()


def write_product(path: Path, text: str) -> Path:
    """Write the output of a command (a card or a fibre table) to a file; return its path.

    If `path` is a link, the function replaces the file at its target. Unfinished files of ended commands are removed.

    Raises:
        CaseError: `path` is a folder, a device or a pipe, lies in no folder, or has the name of a result file.
        FetiHomogError: the file cannot be written; no unfinished file remains.
    """
    if path.exists() and not path.is_file():  # the function would replace a device
        kind = "a folder" if path.is_dir() else "a device or a pipe"
        raise CaseError(f"--out {path}: expected a file, but it is {kind}")
    target = Path(os.path.realpath(path))
    if not target.parent.is_dir():
        raise CaseError(f"--out {path}: expected a file in an existing folder")
    if RESULT_FILE.fullmatch(path.name) or RESULT_FILE.fullmatch(target.name):
        raise CaseError(f"--out {path}: expected another name; results have files of that name")
    atomic.remove_unfinished(target.parent, re.compile(re.escape(target.name)), alone=False)
    atomic.replace_text(target, f"{text}\n")
    return path


def _remove_empty(folders: list[Path]) -> None:
    """Remove nested folders, listed innermost first, up to the first that is not empty."""
    with contextlib.suppress(OSError):
        for folder in folders:
            folder.rmdir()


def _busy(directory: Path, who: str) -> CaseError:
    return CaseError(f"--out {directory}: another run writes its results there: {who}; choose another folder or wait")
