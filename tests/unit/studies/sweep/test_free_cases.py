"""Cases of a sweep that several groups of ranks share."""

from pathlib import Path
from types import SimpleNamespace

from mpi4py import MPI

from feti_homog.studies.case_runs import CaseRunner, Outcome
from feti_homog.system.runtime.file_locks import LOCK_TIMEOUT_S


def test_cases_of_others_are_passed_over_at_once_and_tried_again_at_last():
    """The first case is computed elsewhere, somebody looks at the lock of the second."""
    calls, done = [], set()

    def run(entry, timeout, _):
        calls.append((entry, timeout))
        if entry == 1 or (entry == 2 and timeout == 0.0):
            return Outcome.HELD_ELSEWHERE, "another"
        if entry in done:
            return Outcome.FINISHED_BEFORE, ""
        done.add(entry)
        return Outcome.COMPUTED, ""

    runner = SimpleNamespace(run=run, comm=MPI.COMM_SELF, sweep=SimpleNamespace(entries=(1, 2, 3)))
    runner.directory = Path("sweep")
    assert CaseRunner.run_free(runner, shows=False) is None
    assert done == {2, 3}
    assert calls == [(entry, timeout) for timeout in (0.0, 0.0, LOCK_TIMEOUT_S, LOCK_TIMEOUT_S) for entry in (1, 2, 3)]
