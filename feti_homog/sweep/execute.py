"""Running the cases of a sweep: all of them, by groups of ranks, or one of a job array."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from feti_homog.analysis.runner import run
from feti_homog.common.file_locks import Busy, Lock
from feti_homog.common.mpi_errors import on_root, on_root_only, others_come
from feti_homog.config.case import Case
from feti_homog.errors import CaseError, ConvergenceError, FetiHomogError, MeshError
from feti_homog.output.text.point_tables import sweep_failures, sweep_table
from feti_homog.sweep import store
from feti_homog.sweep.plan import Entry, Sweep
from feti_homog.sweep.store import BAD, DAMAGED, DONE, LOCK, WAITING

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

PATIENCE = 5.0  # seconds that a rank whose case failed waits for the others to say so too
BUSY, COMPUTED = "busy", "computed"


@dataclass(frozen=True)
class Runner:
    """Runs cases of one sweep on the ranks of `comm`; `retry` takes up failed ones, `quiet` tells of none."""

    comm: Intracomm
    directory: Path
    retry: bool
    quiet: bool

    def run(self, entry: Entry, case: Case, total: int) -> tuple[str, str]:
        """Run a case unless it is finished, failed before, or is somebody else's.  Collective.

        Returns what was done (or found), and who has it if that is somebody else.  Raises FetiHomogError if the
        folder cannot be written.
        """
        lock = Lock(self.directory / entry.folder / LOCK)
        try:
            found, words = on_root(self.comm, self._claim, lock, entry, case)
            if found != COMPUTED:
                return found, words
            start = time.perf_counter()
            status = self._compute(entry, case)
            took = time.perf_counter() - start
            self._say(f"{entry.folder} of {total}: {status}, {took:.2f} s; {entry.words(case.output.stress_unit)}")
            return COMPUTED, ""
        finally:
            lock.release()

    def _claim(self, lock: Lock, entry: Entry, case: Case) -> tuple[str, str]:
        """Take the case's lock if it is to be run."""
        folder = self.directory / entry.folder
        try:
            folder.mkdir(exist_ok=True)
            lock.acquire()
        except Busy as busy:
            return BUSY, str(busy)
        except OSError as error:
            raise FetiHomogError(f"cannot make {folder}: {error.strerror}") from error
        state = store.state(self.directory, entry, own=True)
        if state.status == DONE or (state.status in BAD and not self.retry):
            lock.release()
            return state.status, state.reason
        if state.status == DAMAGED:
            self._say(f"{entry.folder}: {state.reason}; set aside, the case is computed again")
        if state.status != WAITING:
            store.forget(self.directory, entry, state.status)
        store.begin(self.directory, entry, case)
        return COMPUTED, ""

    def _compute(self, entry: Entry, case: Case) -> str:
        """Run a case and keep its error if it is the case's own.  Collective; returns its status in words."""
        try:
            run(case, self.directory / entry.folder, self.comm, quiet=True, resume=case.path is not None)
            return DONE
        except (CaseError, MeshError, ConvergenceError) as error:
            if not others_come(self.comm, PATIENCE):
                raise
            on_root_only(self.comm, store.fail, self.directory, entry, error)
            return f"failed ({error.faults[0]})"

    def _say(self, line: str) -> None:
        if self.comm.rank == 0 and not self.quiet:
            print(line, flush=True)


def listed(sweep: Sweep, directory: Path | None) -> list[str]:
    """The cases in a table, with their status if a folder is given.  On one rank."""
    states = ["" if directory is None else store.state(directory, entry).status for entry in sweep.entries]
    words = [entry.words(sweep.stress_unit) for entry in sweep.entries]
    return sweep_table(list(zip([entry.folder for entry in sweep.entries], states, words, strict=True)))


def run_all(sweep: Sweep, directory: Path, comm: Intracomm, ranks_per_case: int, retry: bool, quiet: bool) -> None:
    """Run all cases, each on so many ranks; as many at once as there are such groups.  Collective.

    `ranks_per_case` divides the number of ranks.

    Raises:
        CaseError: the folder cannot be used: it holds another sweep, or another process runs this one.
        ConvergenceError: cases failed; they are told of.
        FetiHomogError: a result could not be written; the finished ones are kept.
    """
    with _sweep_lock(directory, comm, sweep, shared=False):
        group = comm if ranks_per_case == comm.size else _group(comm, ranks_per_case)
        if retry:
            on_root_only(comm, _forget_failures, directory, sweep)
        runner = Runner(group, directory, False, quiet)
        fault = _run_free(runner, sweep)
        faults = [fault for fault in comm.allgather(fault) if fault is not None]
        if faults:
            kept = "finished cases are kept; the same command goes on with the others"
            raise FetiHomogError(*dict.fromkeys(line for fault in faults for line in fault.faults), kept)
    states = on_root(comm, lambda: [store.state(directory, entry) for entry in sweep.entries])
    statuses = [state.status for state in states]
    bad = [(entry, state.reason) for entry, state in zip(sweep.entries, states, strict=True) if state.status in BAD]
    if comm.rank == 0 and not quiet:
        print(f"{statuses.count(DONE)} of {len(states)} cases done in {directory}", flush=True)
    if bad:
        unit = sweep.stress_unit
        if comm.rank == 0:
            print(*sweep_failures([(e.folder, e.words(unit), reason) for e, reason in bad]), sep="\n", flush=True)
        raise ConvergenceError(f"{len(bad)} of {len(states)} cases failed; --retry computes them again")


def run_one(sweep: Sweep, number: int, directory: Path, comm: Intracomm, retry: bool, quiet: bool) -> None:
    """Run the case of that number (from 1) on all ranks; others may be run at the same time.  Collective.

    Raises:
        CaseError: as `run_all`, or there is no such case, or another process has it.
        ConvergenceError: the case failed, now or before.
        FetiHomogError: its result could not be written.
    """
    if not 1 <= number <= len(sweep.entries):
        raise CaseError(f"--index {number}: expected the number of a case, 1 to {len(sweep.entries)}")
    entry, case = sweep.entries[number - 1], sweep.cases[number - 1]
    with _sweep_lock(directory, comm, sweep, shared=True):
        found, words = Runner(comm, directory, retry, quiet).run(entry, case, len(sweep.entries))
    if found == BUSY:
        raise CaseError(f"--index {number}: {entry.folder} is being computed by {words}")
    if found == DONE and comm.rank == 0 and not quiet:
        print(f"{entry.folder} is finished: nothing to do", flush=True)
    state = on_root(comm, store.state, directory, entry)
    if state.status in BAD:
        hint = "" if found == COMPUTED else "; it failed before, --retry computes it again"
        raise ConvergenceError(f"{entry.folder} ({entry.words(sweep.stress_unit)}): {state.reason}{hint}")


def _group(comm: Intracomm, ranks: int) -> Any:
    """This rank's group of so many neighbours."""
    return comm.Split(comm.rank // ranks)


def _run_free(runner: Runner, sweep: Sweep) -> FetiHomogError | None:
    """Run whatever case is free until none is; returns what made the group stop before."""
    took = True
    try:
        while took:
            took = False
            for entry, case in zip(sweep.entries, sweep.cases, strict=True):
                found, _ = runner.run(entry, case, len(sweep.entries))
                took = took or found == COMPUTED
    except FetiHomogError as error:
        if not others_come(runner.comm, PATIENCE):
            raise
        if runner.comm.rank == 0:
            print(*error.faults, sep="\n", file=sys.stderr, flush=True)
        return error
    return None


def _forget_failures(directory: Path, sweep: Sweep) -> None:
    for entry in sweep.entries:
        state = store.state(directory, entry)
        if state.status in BAD:
            store.forget(directory, entry, state.status)


@contextmanager
def _sweep_lock(directory: Path, comm: Intracomm, sweep: Sweep, shared: bool) -> Iterator[None]:
    """The folder made and held: by one sweep, or by any number of single cases."""
    lock = Lock(directory / LOCK, shared)
    on_root(comm, _hold, lock, directory, sweep)
    try:
        yield
    finally:
        lock.release()


def _hold(lock: Lock, directory: Path, sweep: Sweep) -> None:
    store.prepare(directory, sweep)
    try:
        lock.acquire()
    except Busy as busy:
        who = str(busy) if lock.shared else f"{busy} (or single cases of it)"
        raise CaseError(f"--out {directory}: this sweep is being run by {who}") from busy
