"""Print output and errors (a failed write does not stop a run), show progress, and end the process after signals.

After Ctrl-C, or a signal from a launcher or batch system, the process prints one line and ends at once.  Python runs
signal handlers only between bytecodes, so a mesher or a factorization may delay them for a long time; libraries
replace handlers; and an exception in the middle of a collective call would leave other ranks waiting.  So the signals
are blocked, and a thread waits for them.
"""

from __future__ import annotations

import contextlib
import io
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from typing import TYPE_CHECKING

from feti_homog.errors import FetiHomogError, escaped
from feti_homog.system.runtime import file_locks, process

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGXCPU)  # SIGXCPU: the limit of CPU time
# Variables with the rank of a process, which launchers set before MPI starts.
RANK_VARIABLES = ("OMPI_COMM_WORLD_RANK", "PMIX_RANK", "PMI_RANK", "SLURM_PROCID")
# Seconds that other ranks wait for the message of rank 0: Open MPI drops this message once another rank has ended.
SILENT_SECONDS = 5.0
remarks = list[str]()  # lines that rank 0 prints if a signal ends the process
KEPT = "\n\t"  # characters that are printed although they are not printable; others, from files, are escaped


def end_on_signals() -> None:
    """Start a thread that ends the process after SIGINT, SIGTERM or SIGXCPU; the exit code is 128 + signal.

    Before the end, rank 0 prints a line and `remarks` on stderr, and lock files and unfinished files are removed.
    Signals that are ignored, as in a background job, stay ignored; SIGPIPE is blocked.  Call this before threads start.
    """
    awaited = {number for number in ENDING if signal.getsignal(number) is not signal.SIG_IGN}
    # SIGPIPE is not needed: a write reports that the reader of a pipe has closed it.
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
    """Return the rank of this process by the launcher's variables, without MPI; 0 without a launcher."""
    return int(next((os.environ[name] for name in RANK_VARIABLES if os.environ.get(name, "").isdecimal()), 0))


def prepare() -> None:
    """Let stdout and stderr escape unencodable characters, and send closed streams to os.devnull.  Call this first."""
    for number in (0, 1, 2):
        try:
            os.fstat(number)
        except OSError:  # the next file that is opened would have this number, and receive the output
            os.open(os.devnull, os.O_RDWR)
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None or getattr(stream, "closed", False):  # None if it was closed before Python began
            setattr(sys, name, open(os.devnull, "w"))  # noqa: SIM115
        elif isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def say(text: str) -> None:
    """Print a line about the run; after a failure, report it once on standard error and print no more."""
    try:
        print_product(text)
    except FetiHomogError as error:
        complain(f"warning: {error}; result files are not affected")


def print_product(text: str) -> None:
    """Print the product of a command, such as a table.

    Raises:
        FetiHomogError: standard output cannot be written; no error if the reader of a pipe has left.
    """
    try:
        print(escaped(text, KEPT), flush=True)
    except OSError as error:
        with contextlib.suppress(OSError, ValueError):  # later output of PETSc and Python is dropped, too
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if not isinstance(error, BrokenPipeError):  # a reader such as `head` has left
            raise FetiHomogError(f"standard output cannot be written: {error.strerror}") from error


def complain(*lines: str) -> None:
    """Print lines on standard error; a failure is ignored."""
    with contextlib.suppress(OSError):
        print(*(escaped(line, KEPT) for line in lines), sep="\n", file=sys.stderr, flush=True)


class Progress:
    """The progress of a run: lines on rank 0, unless `quiet`, and `seconds` by stage.

    If given, `within` is called with the finished share of the case and a text, in place of a bar.
    """

    def __init__(self, comm: Intracomm, quiet: bool, within: Callable[[float, str], object] | None = None) -> None:
        self.comm, self.within = comm, within
        self.prints = comm.rank == 0 and not quiet
        # Even without a terminal, mpirun gives rank 0 a terminal for its output, but none for its errors.
        self.on_terminal = self.prints and sys.stdout.isatty() and sys.stderr.isatty() and find_spec("tqdm") is not None
        self.seconds: dict[str, float] = {}
        self._inner_seconds = [0.0]  # times of stages within the open stages, with the innermost open stage last

    def say(self, line: str) -> None:
        """Print one line on rank 0, above a progress bar; print nothing if `quiet`."""
        if self.on_terminal:
            from tqdm import tqdm

            with tqdm.external_write_mode(file=sys.stdout):
                say(line)
        elif self.prints:
            say(line)

    @contextlib.contextmanager
    def stage(self, name: str) -> Iterator[list[str]]:
        """Context manager: time a block as a stage of the run and of PETSc's log, and print the time on success.

        The time excludes inner stages.  The block may append remarks to the yielded list; they follow the time.
        """
        from petsc4py import PETSc

        notes: list[str] = []
        start = time.perf_counter()
        self._inner_seconds.append(0.0)
        try:
            with PETSc.Log.Stage(name):
                yield notes
        finally:
            seconds = time.perf_counter() - start
            own_seconds = seconds - self._inner_seconds.pop()
            self._inner_seconds[-1] += seconds
        self.seconds[name] = self.seconds.get(name, 0.0) + own_seconds
        self.say(f"{name:<9} {own_seconds:8.2f} s  {' '.join(notes)}".rstrip())

    def timings(self) -> dict[str, float]:
        """Return the seconds by stage, the maximum over ranks.  Collective."""
        return {name: max(self.comm.allgather(seconds)) for name, seconds in self.seconds.items()}

    def memory(self) -> int:
        """Return the peak of resident memory in bytes, the maximum over ranks.  Collective."""
        return int(max(self.comm.allgather(process.peak_memory())))
