"""Calls on rank 0 and on all ranks whose exceptions are raised on every rank, so that none waits for ever."""

from __future__ import annotations

import sys
import time
import traceback
from array import array
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NoReturn, TypeVar

from feti_homog.errors import ExitCode, FetiHomogError, NoMemoryError
from feti_homog.system.runtime.standard_streams import SILENT_SECONDS, complain

if TYPE_CHECKING:
    from mpi4py.MPI import Comm, Request

T = TypeVar("T")
# A rank with an error waits so long for the others to come with theirs, before it ends the job.
ARRIVAL_TIMEOUT_S = SILENT_SECONDS


class RemoteError(RuntimeError):
    """A defect met on another rank; the text is that rank's traceback."""


def on_root(comm: Comm, function: Callable[..., T], /, *args: Any, **kwargs: Any) -> T:
    """Return function(...) of rank 0, on every rank; its errors are raised on every rank.

    Collective; the other ranks' arguments do not matter. The result must be picklable; `function` must
    not communicate.
    """
    result: T = comm.bcast(on_root_only(comm, function, *args, **kwargs), root=0)
    return result


def on_root_only(comm: Comm, function: Callable[..., T], /, *args: Any, **kwargs: Any) -> T | None:
    """Return function(...) on rank 0, None on the others; its errors are raised on every rank.  Collective."""
    result, error = _attempt(function, *args, **kwargs) if comm.rank == 0 else (None, None)
    message = comm.bcast(_portable(comm, error), root=0)
    if message is not None:
        raise message if isinstance(error, MemoryError) else error or message
    return result


def agree(comm: Comm, function: Callable[..., T], /, *args: Any, **kwargs: Any) -> T:
    """Return function(...) of each rank on that rank; if it raises on any, every rank raises.

    A rank that met a defect raises it; all others raise the defect of the first such rank or, if there was none, the
    FetiHomogError of the first rank that met one, NoMemoryError of one without memory. Collective; `function` must not
    communicate.
    """
    return _agreed(comm, *_attempt(function, *args, **kwargs))


def _agreed(comm: Comm, result: T | None, error: Exception | None) -> T:
    messages = [message for message in comm.allgather(_portable(comm, error)) if message is not None]
    if messages:
        if error is not None and not isinstance(error, FetiHomogError | MemoryError):
            raise error
        raise next((message for message in messages if isinstance(message, RemoteError)), messages[0])
    return result  # type: ignore[return-value]


def agree_after(comm: Comm, function: Callable[..., T], /, *args: Any, **kwargs: Any) -> T:
    """Return function(...) of all ranks, a library's collective call.

    If any raises a FetiHomogError, every rank does.  Any other exception is raised by its rank alone, without a word
    to the others, which may be waiting for it within `function`: it must end the job, as does a FetiHomogError for
    which the others do not come in time.  Collective.
    """
    result = error = None
    try:
        result = function(*args, **kwargs)
    except FetiHomogError as met:
        error = met
    failed_here, failed = array("i", [error is not None]), array("i", [0])
    request = comm.Iallreduce(failed_here, failed)
    if error is None:
        request.Wait()
    elif not _comes(request, ARRIVAL_TIMEOUT_S):
        end_job(comm, error)
    return _agreed(comm, result, error) if failed[0] else result  # type: ignore[return-value]


def run_main(comm: Comm, main: Callable[[], int]) -> int:
    """Return the exit code of main(), run by every rank.

    A FetiHomogError that every rank raises is printed once, by rank 0, and gives its exit code. One that the
    others do not raise in time, and any other exception, is printed by its rank and aborts the job.
    """
    try:
        return main()
    except FetiHomogError as error:
        if not others_come(comm, ARRIVAL_TIMEOUT_S):
            end_job(comm, error)
        if comm.rank == 0:
            complain(_lines(error))
        return error.exit_code
    except Exception as error:
        end_job(comm, error)


def end_job(comm: Comm, error: BaseException) -> NoReturn:
    """Tell of an error that one rank has met alone, and end the processes of all."""
    ending = _without_memory(comm, error) if isinstance(error, MemoryError) else error
    if isinstance(ending, FetiHomogError):
        code, lines = ending.exit_code, _lines(ending)
    else:
        code = ExitCode.DEFECT
        lines = f"rank {comm.rank} of {comm.size}:\n{''.join(traceback.format_exception(error))}"
    complain(lines)
    sys.stdout.flush()
    comm.Abort(code)
    raise SystemExit(code)


def _without_memory(comm: Comm, error: MemoryError) -> NoMemoryError:
    """Return the error in a line for the user."""
    detail = f": {error}" if str(error) else ""
    hint = "`feti-homog check` estimates what a case needs, and more ranks share it"
    return NoMemoryError(f"rank {comm.rank} of {comm.size} has no memory left{detail}; {hint}")


def others_come(comm: Comm, timeout: float) -> bool:
    """Return whether every rank calls this within `timeout` seconds of this one."""
    return _comes(comm.Ibarrier(), timeout)


def all_raise(comm: Comm, error: BaseException) -> bool:
    """Return whether all ranks have met an error for the user, so that they can clean up together.

    Each rank with such an error calls it, and waits ARRIVAL_TIMEOUT_S for the others; a defect is one rank's own.
    """
    return isinstance(error, FetiHomogError) and others_come(comm, ARRIVAL_TIMEOUT_S)


def _comes(request: Request, timeout: float) -> bool:
    """Wait for a request, `timeout` seconds at most; return True if it is fulfilled."""
    deadline = time.monotonic() + timeout
    while not (is_fulfilled := request.Test()) and time.monotonic() < deadline:
        time.sleep(0.001)
    return is_fulfilled


def _lines(error: FetiHomogError) -> str:
    """Return a line for each fault."""
    return "\n".join(f"error: {fault}" for fault in error.faults)


def _attempt(function: Callable[..., T], *args: Any, **kwargs: Any) -> tuple[T | None, Exception | None]:
    try:
        return function(*args, **kwargs), None
    except OSError as error:
        if error.filename is None:
            return None, error
        return None, FetiHomogError(f"{error.filename}: {error.strerror}")  # a file's fault, not the program's
    except Exception as error:
        return None, error


def _portable(comm: Comm, error: Exception | None) -> Exception | None:
    """Return the exception as it is sent to other ranks: a defect as its traceback, for it may not be picklable."""
    if error is None or isinstance(error, FetiHomogError):
        return error
    if isinstance(error, MemoryError):
        return _without_memory(comm, error)
    return RemoteError(f"on rank {comm.rank}:\n{''.join(traceback.format_exception(error))}")
