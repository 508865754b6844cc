"""What a run leaves when it ends early: the torn cell and the results folder."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
from mpi4py import MPI
from support.cases import make_case

from feti_homog.analysis import runner
from feti_homog.common.progress import Progress
from feti_homog.errors import CaseError


@pytest.mark.parametrize(("error", "destroyed"), [(None, 1), (CaseError("refused"), 1), (MemoryError("defect"), 0)])
def test_only_ranks_that_all_come_destroy_the_solver(monkeypatch, error, destroyed):
    """After a defect, which may be one rank's own, the others would not come to the collective call."""
    calls = []
    cell = SimpleNamespace(solver=SimpleNamespace(destroy=lambda: calls.append("destroy")))
    monkeypatch.setattr(runner, "tear", lambda case, comm, progress: cell)
    comm = MPI.COMM_SELF
    try:
        with runner._torn(make_case(fibre_fraction=0.4, mesh_size=0.3), comm, Progress(comm, quiet=True)):
            if error is not None:
                raise error
    except (CaseError, MemoryError) as caught:
        assert caught is error
    assert len(calls) == destroyed
