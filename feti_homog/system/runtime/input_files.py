"""Files that users name: regular ones, of bounded size; files that wait for a writer or have no end are refused.

A library that may crash on a damaged file reads it in a process of its own.
"""

import errno
import multiprocessing
import os
import resource
import signal
import stat
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO, TypeVar

from feti_homog.errors import CaseError, FetiHomogError

T = TypeVar("T")
MOST_BYTES = 1 << 30
PATIENCE = 300.0  # seconds
STATM = Path("/proc/self/statm")


def opened(path: Path, pipes: bool = False) -> BinaryIO:
    """Open a file for reading.

    With `pipes` it may be anything but a folder, as in a shell's `<(...)`; a device may never end.

    Raises:
        OSError: it cannot be opened, or is no regular file.
    """
    descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC | (0 if pipes else os.O_NONBLOCK))
    kind = os.fstat(descriptor).st_mode
    if stat.S_ISREG(kind) or (pipes and not stat.S_ISDIR(kind)):
        return open(descriptor, "rb")
    os.close(descriptor)
    if stat.S_ISDIR(kind):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
    raise OSError(errno.EINVAL, "it is a pipe" if stat.S_ISFIFO(kind) else "it is no file but a device")


def read(path: Path, most: int = MOST_BYTES, pipes: bool = False) -> bytes:
    """Return the content of a file opened by `opened`.

    Raises:
        OSError: as `opened`; also for a file of more than `most` bytes.
    """
    with opened(path, pipes) as stream:
        size = os.fstat(stream.fileno()).st_size  # 0 of pipes
        content = b"" if size > most else stream.read((size or most) + 1)
    if size > most or len(content) > most:
        raise OSError(errno.EFBIG, f"it has more than {most >> 20} MiB")
    return content


def unreadable(path: Path, error: OSError) -> FetiHomogError:
    """Return the error to raise for a file of results: bad input where it is missing or no file, else a failure."""
    kind = FetiHomogError if isinstance(error, PermissionError) else CaseError
    return kind(f"cannot read {path}: {error.strerror or error}")


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

    def send() -> None:
        # The parent's thread listens for signals; Ctrl-C ends both processes.  Handlers of PETSc, in a program that has
        # started it, would not come to an end here.
        for number in (signal.SIGINT, signal.SIGSEGV, signal.SIGBUS, signal.SIGFPE, signal.SIGILL, signal.SIGABRT):
            signal.signal(number, signal.SIG_DFL)
        signal.pthread_sigmask(signal.SIG_SETMASK, ())
        if memory is not None:
            limits, used = resource.getrlimit(resource.RLIMIT_AS), int(STATM.read_text().split()[0])
            most = used * resource.getpagesize() + memory
            resource.setrlimit(resource.RLIMIT_AS, (min({most, *limits} - {resource.RLIM_INFINITY}), limits[1]))
        try:
            sender.send(function(path))
        except FetiHomogError as error:
            sender.send(error)
        except MemoryError as error:
            sender.send(CaseError(f"{path}: its files are damaged: {error}"))

    process = context.Process(target=send, daemon=True)
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
