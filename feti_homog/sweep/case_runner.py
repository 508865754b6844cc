"""Running one case of a sweep in its folder, unless that was done before or another process does it."""

from __future__ import annotations

import time
from dataclasses import dataclass
from enum import Enum, auto
from pathlib import Path
from typing import TYPE_CHECKING

from feti_homog.analysis.runner import run
from feti_homog.case.case import Case
from feti_homog.errors import CaseError, ConvergenceError, FetiHomogError, MeshError
from feti_homog.parallel.mpi_errors import ARRIVAL_TIMEOUT_S, on_root, on_root_only, others_come
from feti_homog.runtime.file_locks import LockHeld, TemporaryLock
from feti_homog.runtime.standard_streams import say
from feti_homog.sweep import store
from feti_homog.sweep.plan import SweepCase
from feti_homog.sweep.store import LOCK_FILE, Status

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm


class Outcome(Enum):
    """What came of a request to run a case."""

    COMPUTED = auto()
    FINISHED_BEFORE = auto()
    FAILED_BEFORE = auto()
    HELD_ELSEWHERE = auto()


@dataclass(frozen=True)
class CaseRunner:
    """Runs cases of one sweep on the ranks of `comm`; `retry` takes up failed ones, `quiet` prints nothing."""

    comm: Intracomm
    directory: Path
    retry: bool
    quiet: bool

    def run(self, entry: SweepCase, case: Case, total: int) -> tuple[Outcome, str]:
        """Run a case unless it is finished, failed before, or another process has it.  Collective.

        Returns what came of it, and which process has the case if another one has.  Raises FetiHomogError if the
        folder cannot be written.
        """
        lock = TemporaryLock(self.directory / entry.folder / LOCK_FILE)
        try:
            outcome, holder = on_root(self.comm, self._claim, lock, entry, case)
            if outcome is not Outcome.COMPUTED:
                return outcome, holder
            start = time.perf_counter()
            status = self._compute(entry, case)
            seconds = time.perf_counter() - start
            inputs = entry.describe(case.output.stress_unit)
            self._print(f"{entry.folder} of {total}: {status}, {seconds:.2f} s; {inputs}")
            return Outcome.COMPUTED, ""
        finally:
            lock.release()

    def _claim(self, lock: TemporaryLock, entry: SweepCase, case: Case) -> tuple[Outcome, str]:
        """Take the case's lock, and keep it if the case is to be computed."""
        folder = self.directory / entry.folder
        try:
            folder.mkdir(exist_ok=True)
            lock.acquire()
        except LockHeld as holder:
            return Outcome.HELD_ELSEWHERE, str(holder)
        except OSError as error:
            raise FetiHomogError(f"cannot make {folder}: {error.strerror}") from error
        state = store.stored_state(self.directory, entry)
        if state.status is Status.DONE or (state.status.is_failure and not self.retry):
            lock.release()
            return Outcome.FAILED_BEFORE if state.status.is_failure else Outcome.FINISHED_BEFORE, ""
        if state.status is Status.DAMAGED:
            self._print(f"{entry.folder}: {state.reason}; set aside, the case is computed again")
        if state.status is not Status.WAITING:
            store.reset(self.directory, entry, state.status)
        store.write_case_file(self.directory, entry, case)
        return Outcome.COMPUTED, ""

    def _compute(self, entry: SweepCase, case: Case) -> str:
        """Run a case and keep its error if it is the case's own.  Collective; returns its status in words."""
        try:
            run(case, self.directory / entry.folder, self.comm, quiet=True, resume=case.section.is_followed)
            return Status.DONE
        except (CaseError, MeshError, ConvergenceError) as error:
            if not others_come(self.comm, ARRIVAL_TIMEOUT_S):
                raise
            on_root_only(self.comm, store.write_error, self.directory, entry, error)
            return f"failed ({error.faults[0]})"
        except FetiHomogError:  # a file could not be written: the case is to be computed again
            if others_come(self.comm, ARRIVAL_TIMEOUT_S):
                on_root_only(self.comm, store.set_aside, self.directory, entry, Status.DAMAGED)
            raise

    def _print(self, line: str) -> None:
        if self.comm.rank == 0 and not self.quiet:
            say(line)
