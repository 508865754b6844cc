"""Cases of a sweep that several groups of ranks share, and materials that do not suit the first mesh."""

import tomllib
from pathlib import Path
from types import SimpleNamespace

import pytest
from mpi4py import MPI
from support.base_case import MESH_CELL, changed

from feti_homog.errors import CaseError
from feti_homog.studies import case_runs, sweep_cases
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


def test_meshes_without_a_material_of_their_matrix_are_refused_before_any_case(tmp_path):
    document = tomllib.loads(changed(MESH_CELL))
    del document["material"]["matrix"]
    files = [str(Path(__file__).parents[4] / "meshes" / f"{name}.msh") for name in ("square", "hexagonal")]
    sweep = sweep_cases.expand(document | {"sweep": {"cell.file": files}}, tmp_path)
    with pytest.raises(CaseError) as caught:
        case_runs.run_all(sweep, tmp_path / "out", MPI.COMM_SELF, 1, retry=False, quiet=True)
    assert caught.value.faults == ("[material.matrix]: missing section; the mesh has this phase",)
    assert not (tmp_path / "out").exists()
