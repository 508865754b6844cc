"""A function in a process of its own: HDF5 may crash on wrong bytes, or not come to an end."""

from __future__ import annotations

import multiprocessing
import signal
from collections.abc import Callable
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TypeVar

from feti_homog.errors import CaseError

T = TypeVar("T")
PATIENCE = 300.0  # seconds


def in_own_process(directory: Path, function: Callable[[Path], T], patience: float = PATIENCE) -> T:
    """function(directory).

    Raises:
        CaseError: of the function, or its process crashed or took longer than `patience`.
    """
    context = multiprocessing.get_context("fork")
    ours, theirs = context.Pipe(duplex=False)
    process = context.Process(target=_send, args=(theirs, function, directory), daemon=True)
    process.start()
    theirs.close()
    try:
        if not ours.poll(patience):
            raise CaseError(f"{directory}: its files are damaged: reading them does not come to an end")
        answer = ours.recv()
    except EOFError:
        raise CaseError(f"{directory}: its files are damaged: HDF5 crashes on them") from None
    finally:
        process.kill()
        process.join()
    if isinstance(answer, CaseError):
        raise answer
    found: T = answer
    return found


def _send(end: Connection, function: Callable[[Path], T], directory: Path) -> None:
    # The thread that listens for signals stays with the parent; Ctrl-C ends both.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_SETMASK, ())
    try:
        end.send(function(directory))
    except CaseError as error:
        end.send(error)
    except MemoryError as error:
        end.send(CaseError(f"{directory}: its files are damaged: {error}"))
