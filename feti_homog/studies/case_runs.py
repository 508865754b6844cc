"""Run the sweep cases: all cases in groups of ranks, or a single case in a job array."""

import json
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from enum import Enum, auto
from pathlib import Path
from shlex import quote
from typing import Any

from feti_homog.analysis import description, runner, stepped_progress
from feti_homog.case import Case, cases, sections
from feti_homog.errors import CaseError, ConvergenceError, FetiHomogError, MeshError
from feti_homog.homogenization import partition_policy, tile_tearing
from feti_homog.studies import case_folders
from feti_homog.studies.sweep_cases import Sweep, SweepCase, case_names, expand
from feti_homog.system.parallel import mpi_errors
from feti_homog.system.petsc import options_database
from feti_homog.system.runtime import file_locks, standard_streams
from feti_homog.typing import Intracomm


def list_cases(sweep: Sweep, directory: Path | None) -> list[str]:
    """Return a line for each case of a sweep; with `directory` also status and progress.  On one rank.

    Raises CaseError if `directory` holds another sweep or a damaged list.
    """
    if directory is None:
        return [f"{entry.folder}  {entry.describe(sweep.stress_unit)}".rstrip() for entry in sweep.entries]
    case_folders.refuse_other_sweep(directory, sweep)
    states, lines = [case_folders.case_state(directory, entry) for entry in sweep.entries], list[str]()
    width = max(len(state.status) for state in states)
    for entry, state in zip(sweep.entries, states, strict=True):
        line = f"{entry.folder}  {state.status:<{width}}  {entry.describe(sweep.stress_unit)}".rstrip()
        lines.append(f"{line}; {state.reason}" if state.reason and not state.status.is_failure else line)
    return lines


def group_size(comm: Intracomm, ranks_per_case: int | None) -> int:
    """Return the number of ranks per case, by default all.  Raises CaseError unless it divides the size of `comm`."""
    size = comm.size if ranks_per_case is None else ranks_per_case
    if size < 1 or comm.size % size:
        raise CaseError(f"--ranks-per-case {size}: expected a divisor of the {comm.size} ranks")
    return size


def run_all(
    sweep: Sweep, directory: Path, comm: Intracomm, ranks_per_case: int | None, retry: bool, quiet: bool | None
) -> None:
    """Run all unfinished cases of a sweep.  Collective.

    A group of `ranks_per_case` ranks, by default all, runs one case; the groups work concurrently.  With `retry`,
    failed cases run again.  With `quiet` True only failures are printed; with None the first group also shows the
    progress; with False the groups also print a line for each case, and rank 0 a summary.

    Raises:
        CaseError: PETSc options or materials are faulty, `ranks_per_case` does not divide the rank count, or the folder
            cannot be used: it holds another sweep, or another process runs this sweep.
        ConvergenceError: cases failed; rank 0 prints the failures.
        FetiHomogError: a result could not be written; finished results are kept.
    """
    size = group_size(comm, ranks_per_case)
    check_options(sweep)
    if sweep.cases[0].cell.has_own_mesh and "matrix" not in sweep.cases[0].materials:  # few meshes lack this phase
        with suppress(MeshError):  # a fault of this case only
            mpi_errors.on_root_only(comm, tile_tearing.begin_mesh, sweep.cases[0], partition_policy.BY_COST.tiles)
    with _sweep_lock(directory, comm, sweep, shared=False):
        group: Any = comm if size == comm.size else comm.Split(comm.rank // size)
        if retry:

            def reset_failures() -> None:
                for entry in sweep.entries:
                    status = case_folders.case_state(directory, entry).status
                    if status.is_failure:
                        case_folders.reset(directory / entry.folder, status)

            mpi_errors.on_root_only(comm, reset_failures)
        fault = CaseRunner(group, directory, sweep, False, quiet is not False).run_free(comm.rank < size and not quiet)
        if errors := [error for error in comm.allgather(fault) if error is not None]:
            remark = "finished cases are kept"
            kind = CaseError if all(isinstance(error, CaseError) for error in errors) else FetiHomogError
            raise kind(*dict.fromkeys(line for error in errors for line in error.faults), remark)
    states = mpi_errors.on_root(comm, lambda: [case_folders.case_state(directory, entry) for entry in sweep.entries])
    failed = [(entry, state) for entry, state in zip(sweep.entries, states, strict=True) if state.status.is_failure]
    if comm.rank == 0 and quiet is False:
        done = sum(state.status is case_folders.Status.DONE for state in states)
        total = f"{done} of {len(states)} cases done; `feti-homog collect {quote(str(directory))}` makes tables of them"
        standard_streams.say("\n".join([*case_folders.note_lines(sweep.entries, states), total]))
    if failed:
        if comm.rank == 0:
            standard_streams.say("\n".join(case_folders.failure_lines(failed, sweep.stress_unit)))
        raise ConvergenceError(f"{len(failed)} of {len(states)} cases failed; --retry computes them again")


def run_one(sweep: Sweep, number: int, directory: Path, comm: Intracomm, retry: bool, quiet: bool) -> None:
    """Run the sweep case `number`, from 1, on all ranks.  Collective.

    Other jobs may run other cases at the same time.  `retry` and `quiet` are as in `CaseRunner`.

    Raises:
        CaseError: as for `run_all`, or the number is out of range, or another process runs the case.
        ConvergenceError: the case failed, now or before.
        FetiHomogError: the result could not be written.
    """
    if not 1 <= number <= len(sweep.entries):
        raise CaseError(f"--index {number}: expected the number of a case, 1 to {len(sweep.entries)}")
    check_options(sweep)
    entry = sweep.entries[number - 1]
    with _sweep_lock(directory, comm, sweep, shared=True):
        outcome, holder = CaseRunner(comm, directory, sweep, retry, quiet).run(entry)
    if outcome is Outcome.HELD_ELSEWHERE:
        raise CaseError(f"--index {number}: {entry.folder} is being computed by {holder}")
    if outcome is Outcome.FINISHED_BEFORE and comm.rank == 0 and not quiet:
        standard_streams.say(f"{entry.folder} is finished: nothing to do")
    state = mpi_errors.on_root(comm, case_folders.case_state, directory, entry)
    if state.status.is_failure:
        hint = "; it failed before, --retry computes it again" if outcome is Outcome.FAILED_BEFORE else ""
        raise ConvergenceError(f"{entry.folder} ({entry.describe(sweep.stress_unit)}): {state.reason}{hint}")


@contextmanager
def _sweep_lock(directory: Path, comm: Intracomm, sweep: Sweep, shared: bool) -> Iterator[None]:
    """Context manager: make and lock the sweep folder.  Raises CaseError if another run holds it.  Collective."""
    lock = file_locks.Lock(directory / case_folders.LOCK_FILE, shared)

    def prepare() -> None:
        case_folders.prepare_folder(directory, sweep)
        try:
            lock.acquire()
        except file_locks.LockHeld as holder:
            who = str(holder) if shared else f"{holder} (or single cases of it)"
            raise CaseError(f"--out {directory}: this sweep is being run by {who}") from holder

    mpi_errors.on_root(comm, prepare)
    try:
        yield
    finally:
        lock.release()


class Outcome(Enum):
    """Outcome of a request to run a case.  A COMPUTED case may have failed."""

    COMPUTED = auto()
    FINISHED_BEFORE = auto()
    FAILED_BEFORE = auto()
    HELD_ELSEWHERE = auto()


@dataclass(frozen=True)
class CaseRunner:
    """A group of ranks, `comm`, that runs sweep cases.  `retry` repeats failed cases; `quiet` prints no lines."""

    comm: Intracomm
    directory: Path
    sweep: Sweep
    retry: bool
    quiet: bool

    def run_free(self, shows: bool) -> FetiHomogError | None:
        """Run cases until none is left, and show the progress if `shows`.  Collective in the group.

        The group computes a case once, also if its result is damaged at once.  It skips cases that others hold; in a
        last round it waits for their locks.  Returns the error that stopped the group or, at the end, the faults of
        begun paths; else None.  Raises the error if other ranks of the group do not report an error in time.
        """
        timeouts, count, faults = [0.0, file_locks.LOCK_TIMEOUT_S], len(self.sweep.entries), dict[str, None]()
        computed = set[int]()
        progress, label = standard_streams.Progress(self.comm, quiet=not shows), f"cases of {self.directory.name}"
        try:
            with stepped_progress.shown(progress, label) as advance:
                while timeouts:
                    outcomes = list[Outcome]()
                    for number, entry in enumerate(self.sweep.entries, 1):
                        if number in computed:
                            continue
                        try:
                            outcomes.append(self.run(entry, timeouts[0], advance)[0])
                        except CaseError as error:  # of a begun path, which stays; the other cases go on
                            faults |= dict.fromkeys(error.faults)
                            outcomes.append(Outcome.FAILED_BEFORE)
                        is_known = outcomes[-1] is not Outcome.COMPUTED
                        computed |= set() if is_known else {number}
                        advance(number / count, number, f"{number} of {count} cases", is_known)
                    timeouts = timeouts if Outcome.COMPUTED in outcomes else timeouts[1:]
        except FetiHomogError as error:
            if not mpi_errors.others_come(self.comm, mpi_errors.ARRIVAL_TIMEOUT_S):
                raise
            return error
        return CaseError(*faults) if faults else None

    def run(
        self,
        entry: SweepCase,
        timeout: float = file_locks.LOCK_TIMEOUT_S,
        advance: Callable[..., Any] = lambda *_: None,
    ) -> tuple[Outcome, str]:
        """Run a case unless it is finished, failed without `retry`, or held by another process.  Collective.

        The group waits `timeout` seconds for the lock of the case; `advance` shows the share of all cases.  Returns the
        outcome, and the other process that holds the case, or "".  Raises FetiHomogError if a file cannot be written.
        """
        case, folder = self.sweep.cases[entry.number - 1], self.directory / entry.folder
        lock = file_locks.Lock(folder / case_folders.LOCK_FILE, timeout=timeout)
        before, count = entry.number - 1, len(self.sweep.entries)

        def within(share: float, text: str) -> None:
            advance((before + share) / count, before, f"case {entry.number} of {count}: {text}", False)

        try:
            outcome, holder = mpi_errors.on_root(self.comm, self._claim, lock, entry, case)
            if outcome is Outcome.COMPUTED:
                start, status = time.perf_counter(), str(case_folders.Status.DONE)
                try:
                    progress = standard_streams.Progress(self.comm, True, within)
                    runner.run(case, folder, progress, resume=case.section.is_followed)
                except (CaseError, MeshError, ConvergenceError) as error:  # a failure of this case only
                    if not mpi_errors.others_come(self.comm, mpi_errors.ARRIVAL_TIMEOUT_S):
                        raise
                    mpi_errors.on_root_only(self.comm, case_folders.write_error, self.directory, entry, error)
                    status = f"failed ({error.faults[0]})"
                except FetiHomogError:  # a file could not be written: the next run computes the case again
                    if mpi_errors.others_come(self.comm, mpi_errors.ARRIVAL_TIMEOUT_S):
                        damaged = case_folders.Status.DAMAGED
                        mpi_errors.on_root_only(self.comm, case_folders.set_aside, folder, damaged)
                    raise
                seconds, inputs = time.perf_counter() - start, entry.describe(case.output.stress_unit)
                self._print(f"{entry.folder} of {len(self.sweep.entries)}: {status}, {seconds:.2f} s; {inputs}")
            return outcome, holder
        finally:
            lock.release()

    def _claim(self, lock: file_locks.Lock, entry: SweepCase, case: Case) -> tuple[Outcome, str]:
        """Lock a case to run and return COMPUTED, or return another outcome without a lock.  On one rank; see `run`."""
        folder = self.directory / entry.folder
        try:
            folder.mkdir(exist_ok=True)
            lock.acquire()
        except file_locks.LockHeld as holder:
            return Outcome.HELD_ELSEWHERE, str(holder)
        except OSError as error:
            raise FetiHomogError(f"cannot make {folder}: {error.strerror}") from error
        state = case_folders.stored_state(self.directory, entry)
        if state.status is case_folders.Status.DONE or (state.status.is_failure and not self.retry):
            lock.release()
            return Outcome.FAILED_BEFORE if state.status.is_failure else Outcome.FINISHED_BEFORE, ""
        if state.status is case_folders.Status.DAMAGED:
            self._print(f"{entry.folder}: {state.reason}; set aside, the case is computed again")
        if state.status is not case_folders.Status.WAITING:
            case_folders.reset(folder, state.status)
        case_folders.write_case_file(folder, case)
        return Outcome.COMPUTED, ""

    def _print(self, line: str) -> None:
        standard_streams.Progress(self.comm, self.quiet).say(line)  # without damage to the progress bar


def describe(document: dict[str, Any], folder: Path, comm: Intracomm) -> str:
    """Describe a case, or a sweep and its first case, from its document.  Collective.

    Returns text on rank 0, "" elsewhere.  Raises CaseError for a faulty document, MeshError for a faulty cell.
    """
    if sections.SWEEP not in document:
        return description.describe(mpi_errors.on_root(comm, cases.parse, document, folder), comm)
    sweep = mpi_errors.on_root(comm, expand, document, folder)
    points = len({entry.point for entry in sweep.entries})
    heading = f"sweep      {len(sweep.cases)} cases, {points} points, all of them valid; the first:"
    return describe_first(sweep, heading, comm)


def describe_first(sweep: Sweep, heading: str, comm: Intracomm) -> str:
    """Describe the first case of a sweep below a heading.  Collective.

    Returns text on rank 0, "" elsewhere.  Raises CaseError for faulty PETSc options, MeshError for a faulty cell.
    """
    check_options(sweep)
    text = description.describe(sweep.cases[0], comm)
    return f"{heading}\n{text}" if comm.rank == 0 else ""


def check_options(sweep: Sweep) -> None:
    """Check the PETSc options of all cases.  Raises CaseError with all faults, each with its cases."""
    numbers_by_options = dict[str, list[int]]()
    for entry, case in zip(sweep.entries, sweep.cases, strict=True):
        numbers_by_options.setdefault(json.dumps(case.petsc, sort_keys=True), []).append(entry.number)
    faults = []
    for options, numbers in numbers_by_options.items():
        try:
            with options_database.case_options(json.loads(options)):
                pass
        except CaseError as error:
            faults += [f"{case_names(numbers)}: {fault}" for fault in error.faults]
    if faults:
        raise CaseError(*faults)
