"""Call functions on rank 0 or on all ranks, and raise exceptions on every rank, so that no rank waits forever."""

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
# Seconds that a rank with an exception waits for exceptions of the other ranks, before it ends the job.
ARRIVAL_TIMEOUT_S = SILENT_SECONDS


class RemoteError(RuntimeError):
    """An unexpected exception (a defect) on another rank; the text is its traceback."""


def on_root(comm: Comm, function: Callable[..., T], /, *args: Any, **kwargs: Any) -> T:
    """Call a function on rank 0, and return the result on every rank.  Collective.

    An exception on rank 0 is raised on every rank, on other ranks as in `agree`.  Arguments on other ranks are ignored.
    The result must be picklable, and `function` must not communicate.
    """
    result: T = comm.bcast(on_root_only(comm, function, *args, **kwargs), root=0)
    return result


def on_root_only(comm: Comm, function: Callable[..., T], /, *args: Any, **kwargs: Any) -> T | None:
    """Call a function on rank 0, and return the result there, None elsewhere; see `on_root`.  Collective."""
    result, error = _attempt(function, *args, **kwargs) if comm.rank == 0 else (None, None)
    message = comm.bcast(_portable(comm, error), root=0)
    if error is not None and not isinstance(error, MemoryError):
        raise error
    if message is not None:
        raise message
    return result


def agree(comm: Comm, function: Callable[..., T], /, *args: Any, **kwargs: Any) -> T:
    """Call a function on every rank, and return its result; if a rank raises, every rank raises.  Collective.

    `function` must not communicate.  MemoryError becomes NoMemoryError, and OSError with a file name FetiHomogError.
    A rank raises its own defect; other ranks raise RemoteError for the first defect, else the first FetiHomogError.
    """
    return _agreed(comm, *_attempt(function, *args, **kwargs))


def _agreed(comm: Comm, result: T | None, error: Exception | None) -> T:
    """Return the result of this rank or, if any rank has an error, raise like `agree`.  Collective."""
    messages = [message for message in comm.allgather(_portable(comm, error)) if message is not None]
    if messages:
        if error is not None and not isinstance(error, FetiHomogError | MemoryError):
            raise error
        raise next((message for message in messages if isinstance(message, RemoteError)), messages[0])
    return result  # type: ignore[return-value]


def agree_after(comm: Comm, function: Callable[..., T], /, *args: Any, **kwargs: Any) -> T:
    """Call a function that communicates, such as a library's collective function; return its result.  Collective.

    If a rank raises a FetiHomogError, every rank raises.  A rank raises other exceptions alone, because the other ranks
    may wait for it within `function`: the caller must end the job.  The job also ends if the other ranks do not return
    within ARRIVAL_TIMEOUT_S after a FetiHomogError.
    """
    result = error = None
    try:
        result = function(*args, **kwargs)
    except FetiHomogError as caught:
        error = caught
    failed_here, failed = array("i", [error is not None]), array("i", [0])
    request = comm.Iallreduce(failed_here, failed)
    if error is None:
        request.Wait()
    elif not _comes(request, ARRIVAL_TIMEOUT_S):
        end_job(comm, error)
    return _agreed(comm, result, error) if failed[0] else result  # type: ignore[return-value]


def run_main(comm: Comm, main: Callable[[], int]) -> int:
    """Call main() on every rank, and return its exit code.  Collective.

    If every rank raises a FetiHomogError within ARRIVAL_TIMEOUT_S, rank 0 prints its own; the exit code is returned.
    After any other exception, or a FetiHomogError only on some ranks, the rank prints it and aborts the job.
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
    """Print an exception of this rank, and abort the processes of all ranks with the exception's exit code."""
    reported = _without_memory(comm, error) if isinstance(error, MemoryError) else error
    if isinstance(reported, FetiHomogError):
        code, lines = reported.exit_code, _lines(reported)
    else:
        code = ExitCode.DEFECT
        lines = f"rank {comm.rank} of {comm.size}:\n{''.join(traceback.format_exception(error))}"
    complain(lines)
    sys.stdout.flush()
    comm.Abort(code)
    raise SystemExit(code)


def _without_memory(comm: Comm, error: MemoryError) -> NoMemoryError:
    """Convert a MemoryError to a NoMemoryError with one line for the user."""
    detail = f": {error}" if str(error) else ""
    hint = "`feti-homog check` estimates the memory of a case, which more ranks share; `ulimit -v` may limit it"
    return NoMemoryError(f"rank {comm.rank} of {comm.size} has no memory left{detail}; {hint}")


def others_come(comm: Comm, timeout: float) -> bool:
    """Return whether every rank calls `others_come` within `timeout` seconds after this rank."""
    return _comes(comm.Ibarrier(), timeout)


def all_raise(comm: Comm, error: BaseException) -> bool:
    """Return whether all ranks raise a FetiHomogError, so that they can clean up together.

    A rank with a FetiHomogError waits ARRIVAL_TIMEOUT_S for the calls of the other ranks.
    """
    return isinstance(error, FetiHomogError) and others_come(comm, ARRIVAL_TIMEOUT_S)


def _comes(request: Request, timeout: float) -> bool:
    """Wait at most `timeout` seconds for a request; return whether it has completed."""
    deadline = time.monotonic() + timeout
    while not request.Test():
        if time.monotonic() >= deadline:
            return False
        time.sleep(0.001)
    return True


def _lines(error: FetiHomogError) -> str:
    """Return the faults of an error as lines that begin with "error: "."""
    return "\n".join(f"error: {fault}" for fault in error.faults)


def _attempt(function: Callable[..., T], *args: Any, **kwargs: Any) -> tuple[T | None, Exception | None]:
    """Call a function; return (result, None) or (None, exception); OSError with a file name becomes FetiHomogError."""
    try:
        return function(*args, **kwargs), None
    except OSError as error:
        if error.filename is None:
            return None, error
        return None, FetiHomogError(f"{error.filename}: {error.strerror}")  # a fault of the file, not a defect
    except Exception as error:
        return None, error


def _portable(comm: Comm, error: Exception | None) -> Exception | None:
    """Convert an exception (or None) for other ranks: a defect becomes its traceback, as it may not be picklable."""
    if error is None or isinstance(error, FetiHomogError):
        return error
    if isinstance(error, MemoryError):
        return _without_memory(comm, error)
    return RemoteError(f"on rank {comm.rank}:\n{''.join(traceback.format_exception(error))}")
