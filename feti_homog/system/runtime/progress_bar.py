"""Stages of a run: printed on rank 0, timed on every rank, and shown by PETSc's -log_view."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.util import find_spec

from mpi4py import MPI
from petsc4py import PETSc

from feti_homog.system.runtime import process_memory
from feti_homog.system.runtime.standard_streams import say


class Progress:
    """Print a line for each stage and solve on rank 0, unless quiet, and keep the times of stages.

    `within` gets the finished share of the case and its words, in place of a bar.
    """

    def __init__(self, comm: MPI.Intracomm, quiet: bool, within: Callable[[float, str], object] | None = None) -> None:
        self.comm, self.within = comm, within
        self.prints = comm.rank == 0 and not quiet
        # mpirun gives rank 0 a terminal for its output even if mpirun has none itself, but none for its errors.
        self.on_terminal = self.prints and sys.stdout.isatty() and sys.stderr.isatty() and find_spec("tqdm") is not None
        self.seconds: dict[str, float] = {}
        self._within = [0.0]  # seconds that stages within those now open took, the innermost last

    def say(self, line: str) -> None:
        """Print one line on rank 0, past the progress bar if there is one."""
        if self.on_terminal:
            from tqdm import tqdm

            with tqdm.external_write_mode(file=sys.stdout):
                say(line)
        elif self.prints:
            say(line)

    @contextmanager
    def stage(self, name: str) -> Iterator[list[str]]:
        """Provide a PETSc log stage.

        The block may append words to the list, which are printed with its time; stages within it count apart.
        """
        remarks: list[str] = []
        start = time.perf_counter()
        self._within.append(0.0)
        try:
            with PETSc.Log.Stage(name):
                yield remarks
        finally:
            seconds = time.perf_counter() - start
            took = seconds - self._within.pop()
            self._within[-1] += seconds
        self.seconds[name] = self.seconds.get(name, 0.0) + took
        self.say(f"{name:<9} {took:8.2f} s  {' '.join(remarks)}".rstrip())

    def timings(self) -> dict[str, float]:
        """Return the seconds of each stage, the maximum over ranks.  Collective."""
        return {name: self.comm.allreduce(took, MPI.MAX) for name, took in self.seconds.items()}

    def memory(self) -> int:
        """Return the peak resident memory of the case (bytes), the maximum over ranks.  Collective."""
        return int(self.comm.allreduce(process_memory.peak(), MPI.MAX))
