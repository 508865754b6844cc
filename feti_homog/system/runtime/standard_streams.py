"""Standard output and error, without which work goes on, and signals that end the process.

Ctrl-C and a launcher's or batch system's order to end print one line, and the process ends at once.  Python runs its
signal handlers between two of its own steps, which a mesher or a factorization may keep it from for long, libraries
take handlers away, and an exception in the middle of a collective call would leave other ranks waiting.  So the signals
are blocked, and a thread waits for them.
"""

import contextlib
import io
import os
import signal
import sys
import threading
import time

from feti_homog.errors import FetiHomogError, escaped
from feti_homog.system.runtime import file_locks

ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGXCPU)  # the last: the limit of CPU time
# Variables in which launchers give the rank of a process before MPI has started.
RANK_VARIABLES = ("OMPI_COMM_WORLD_RANK", "PMIX_RANK", "PMI_RANK", "SLURM_PROCID")
# How long the others wait for rank 0, which a library may keep from the signal: then Open MPI drops what rank 0 prints.
SILENT_SECONDS = 5.0
remarks = list[str]()  # that rank 0 prints where a signal ends the process
KEPT = "\n\t"  # of the characters that are not printable; others may come from files


def end_on_signals() -> None:
    """Let SIGINT, SIGTERM and SIGXCPU end the process with the exit code 128 + signal: 130, 143 and 152.

    Files of locks and unfinished ones are removed before.  Rank 0 reports it on standard error.  Signals that are
    ignored, as in a background job of a shell, stay so.  Call it before any other thread starts.
    """
    awaited = {number for number in ENDING if signal.getsignal(number) is not signal.SIG_IGN}
    # Writing shows that the reader of a pipe has closed it.
    signal.pthread_sigmask(signal.SIG_BLOCK, {*awaited, signal.SIGPIPE})

    def wait_and_end() -> None:
        number = signal.sigwait(awaited)
        if launched_rank() == 0:
            complain(f"interrupted by {signal.Signals(number).name}", *remarks)
        else:
            time.sleep(SILENT_SECONDS)
        file_locks.remove_files()
        os._exit(128 + number)

    if awaited:
        threading.Thread(target=wait_and_end, daemon=True).start()


def launched_rank() -> int:
    """Return the rank that the launcher gives this process, 0 without one; needs no MPI."""
    return int(next((os.environ[name] for name in RANK_VARIABLES if os.environ.get(name, "").isdecimal()), 0))


def prepare() -> None:
    """Call before anything is printed: characters that the locale lacks are escaped, and closed streams are silent."""
    for number in (0, 1, 2):
        try:
            os.fstat(number)
        except OSError:  # the next file that is opened would take its place, and what is printed
            os.open(os.devnull, os.O_RDWR)
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if getattr(stream, "closed", stream is None):  # None if it was closed before Python began
            setattr(sys, name, open(os.devnull, "w"))  # noqa: SIM115
        elif isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def say(text: str) -> None:
    """Print a line beside the results.  If that fails, nothing more is printed, and standard error reports it once."""
    try:
        print_product(text)
    except FetiHomogError as error:
        complain(f"warning: {error}; result files are not affected")


def print_product(text: str) -> None:
    """Print the product of a command.

    Raises:
        FetiHomogError: it cannot be written, and not because the reader left.
    """
    try:
        print(escaped(text, KEPT), flush=True)
    except OSError as error:
        with contextlib.suppress(OSError, ValueError):  # PETSc's output goes nowhere too, and Python's last
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if not isinstance(error, BrokenPipeError):  # a reader that left, as `head` does, wants no more
            raise FetiHomogError(f"standard output cannot be written: {error.strerror}") from error


def complain(*lines: str) -> None:
    """Print lines on standard error, if that can be written."""
    with contextlib.suppress(OSError):
        print(*(escaped(line, KEPT) for line in lines), sep="\n", file=sys.stderr, flush=True)
