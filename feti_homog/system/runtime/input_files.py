"""Read files that users name: regular files of bounded size, not pipes or devices, which may never end.

A library that may crash on a damaged file reads the file in a separate process.
"""

import ctypes
import errno
import math
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
LEAST_SECONDS, BYTES_A_SECOND = 10.0, 1e5  # of processor time in which a child process reads a file
STATM = Path("/proc/self/statm")


def opened(path: Path, pipes: bool = False) -> BinaryIO:
    """Open a regular file for reading; with `pipes`, also a pipe or a device, such as `<(...)` of a shell.

    Raises:
        OSError: the file cannot be opened, or is not a regular file.
    """
    descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC | (0 if pipes else os.O_NONBLOCK))
    kind = os.fstat(descriptor).st_mode
    if stat.S_ISREG(kind) or (pipes and not stat.S_ISDIR(kind)):
        return open(descriptor, "rb")
    os.close(descriptor)
    if stat.S_ISDIR(kind):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
    raise OSError(errno.EINVAL, "it is a pipe" if stat.S_ISFIFO(kind) else "it is a device, not a file")


def read(path: Path, most: int = MOST_BYTES, pipes: bool = False) -> bytes:
    """Return the content of a file; `pipes` is as in `opened`.

    Raises:
        OSError: as in `opened`, and if a file has more than `most` bytes.
    """
    with opened(path, pipes) as stream:
        size = os.fstat(stream.fileno()).st_size  # 0 for pipes
        content = b"" if size > most else stream.read((size or most) + 1)
    if size > most or len(content) > most:
        raise OSError(errno.EFBIG, f"it has more than {most >> 20} MiB")
    return content


def unreadable(path: Path, error: OSError) -> FetiHomogError:
    """Return the exception for an unreadable file: CaseError, or FetiHomogError if permission is missing."""
    kind = FetiHomogError if isinstance(error, PermissionError) else CaseError
    fault = error.strerror or str(error)
    if "file locking flag" in str(error):
        fault = "it is open in this program: close it, or open it with h5py.File(path, locking=False)"
    return kind(f"cannot read {path}: {fault}")


def in_own_process(path: Path, function: Callable[[Path], T], memory: int, seconds: float | None = None) -> T:
    """Compute function(path), a picklable result, in a child process with at most `memory` further bytes.

    The child ends with this process, or after `seconds` of CPU time (None: by file size), or after 30 `seconds` by the
    clock.

    Raises:
        FetiHomogError: the function raises it.
        CaseError: the process crashes, or lacks memory or time.
    """
    if seconds is None:
        seconds = LEAST_SECONDS + (path.stat().st_size if path.exists() else 0) / BYTES_A_SECOND
    context = multiprocessing.get_context("fork")
    receiver, sender = context.Pipe(duplex=False)

    def send() -> None:
        # The child has no thread that waits for signals, so that Ctrl-C ends both processes.  PETSc's handlers, if
        # PETSc has started, would not end here.
        for number in (signal.SIGINT, signal.SIGSEGV, signal.SIGBUS, signal.SIGFPE, signal.SIGILL, signal.SIGABRT):
            signal.signal(number, signal.SIG_DFL)
        signal.pthread_sigmask(signal.SIG_SETMASK, ())
        ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG: the child ends with its parent
        addresses = int(STATM.read_text().split()[0]) * resource.getpagesize() + memory
        for kind, limit in ((resource.RLIMIT_CPU, math.ceil(seconds)), (resource.RLIMIT_AS, addresses)):
            soft, hard = resource.getrlimit(kind)
            resource.setrlimit(kind, (min({limit, soft, hard} - {resource.RLIM_INFINITY}), hard))
        try:
            sender.send(function(path))
        except FetiHomogError as error:
            sender.send(error)
        except MemoryError as error:
            sender.send(CaseError(f"{path}: damaged, {error}"))

    late = CaseError(f"{path}: damaged, reading does not end within {seconds:g} s")
    process = context.Process(target=send, daemon=True)
    process.start()
    sender.close()
    try:
        # On a busy machine processor time takes longer; `poll` accepts 2e6 s at most.
        answer: T | FetiHomogError = receiver.recv() if receiver.poll(min(30.0 * seconds, 1e6)) else late
    except EOFError:
        process.join()
        crash = CaseError(f"{path}: damaged, the library that reads it crashes")
        answer = late if process.exitcode == -signal.SIGXCPU else crash
    finally:
        process.kill()
        process.join()
    if isinstance(answer, FetiHomogError):
        raise answer
    return answer
