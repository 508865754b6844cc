"""The stages of a run: printed on rank 0, timed on every rank, and logged for PETSc's -log_view."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.util import find_spec

from mpi4py import MPI
from petsc4py import PETSc

from feti_homog.system.runtime import process
from feti_homog.system.runtime.standard_streams import say


class Progress:
    """The progress of a run: lines on rank 0, unless `quiet`, and `seconds` by stage.

    `within` gets the finished share of the case and its words, in place of a bar.
    """

    def __init__(self, comm: MPI.Intracomm, quiet: bool, within: Callable[[float, str], object] | None = None) -> None:
        self.comm, self.within = comm, within
        self.prints = comm.rank == 0 and not quiet
        # Even without a terminal, mpirun gives rank 0 a terminal for its output, but none for its errors.
        self.on_terminal = self.prints and sys.stdout.isatty() and sys.stderr.isatty() and find_spec("tqdm") is not None
        self.seconds: dict[str, float] = {}
        self._inner_seconds = [0.0]  # times of stages within the open stages, with the innermost open stage last

    def say(self, line: str) -> None:
        """Print one line on rank 0, above a progress bar."""
        if self.on_terminal:
            from tqdm import tqdm

            with tqdm.external_write_mode(file=sys.stdout):
                say(line)
        elif self.prints:
            say(line)

    @contextmanager
    def stage(self, name: str) -> Iterator[list[str]]:
        """Time a block as a stage of the run and of PETSc's log, and print its time.

        The block may append remarks to the list, which are printed with the time, less the times of inner stages.
        """
        remarks: list[str] = []
        start = time.perf_counter()
        self._inner_seconds.append(0.0)
        try:
            with PETSc.Log.Stage(name):
                yield remarks
        finally:
            seconds = time.perf_counter() - start
            own_seconds = seconds - self._inner_seconds.pop()
            self._inner_seconds[-1] += seconds
        self.seconds[name] = self.seconds.get(name, 0.0) + own_seconds
        self.say(f"{name:<9} {own_seconds:8.2f} s  {' '.join(remarks)}".rstrip())

    def timings(self) -> dict[str, float]:
        """Return the seconds by stage, the maximum over ranks.  Collective."""
        return {name: self.comm.allreduce(seconds, MPI.MAX) for name, seconds in self.seconds.items()}

    def memory(self) -> int:
        """Return the peak of resident memory in bytes, the maximum over ranks.  Collective."""
        return int(self.comm.allreduce(process.peak_memory(), MPI.MAX))
