"""Functions on files that may be damaged, each in a process of its own: libraries may crash on them."""

import multiprocessing
import resource
import signal
from collections.abc import Callable
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TypeVar

from feti_homog.errors import CaseError, FetiHomogError

T = TypeVar("T")
PATIENCE = 300.0  # seconds
STATM = Path("/proc/self/statm")


def in_own_process(
    path: Path, function: Callable[[Path], T], patience: float = PATIENCE, memory: int | None = None
) -> T:
    """Return function(path), computed in a child process with at most `memory` further bytes.

    Raises:
        FetiHomogError: from the function.
        CaseError: its process crashes or outlasts `patience`.
    """
    context = multiprocessing.get_context("fork")
    receiver, sender = context.Pipe(duplex=False)
    process = context.Process(target=_send, args=(sender, function, path, memory), daemon=True)
    process.start()
    sender.close()
    try:
        if not receiver.poll(patience):
            raise CaseError(f"{path}: its files are damaged: reading them does not come to an end")
        answer = receiver.recv()
    except EOFError:
        raise CaseError(f"{path}: its files are damaged: the library that reads them crashes") from None
    finally:
        process.kill()
        process.join()
    if isinstance(answer, FetiHomogError):
        raise answer
    result: T = answer
    return result


def _send(end: Connection, function: Callable[[Path], T], path: Path, memory: int | None) -> None:
    # The parent's thread listens for signals; Ctrl-C ends both processes.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    # Handlers of PETSc, in a program that has started it, would not come to an end here.
    for crash in (signal.SIGSEGV, signal.SIGBUS, signal.SIGFPE, signal.SIGILL, signal.SIGABRT):
        signal.signal(crash, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_SETMASK, ())
    if memory is not None:
        limits, used = resource.getrlimit(resource.RLIMIT_AS), int(STATM.read_text().split()[0])
        most = used * resource.getpagesize() + memory
        resource.setrlimit(resource.RLIMIT_AS, (min({most, *limits} - {resource.RLIM_INFINITY}), limits[1]))
    try:
        end.send(function(path))
    except FetiHomogError as error:
        end.send(error)
    except MemoryError as error:
        end.send(CaseError(f"{path}: its files are damaged: {error}"))
