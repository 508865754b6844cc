"""The torn cell and the results folder after a run that ends early."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI
from support.cases import make_case

from feti_homog.analysis import runner
from feti_homog.errors import CaseError, ConvergenceError
from feti_homog.homogenization import unit_cell
from feti_homog.results import output_folder
from feti_homog.system.runtime import file_locks
from feti_homog.system.runtime.progress_bar import Progress

SINGULAR = np.linalg.LinAlgError("singular")


@pytest.mark.parametrize(
    ("error", "destroyed"), [(None, 1), (CaseError("refused"), 1), (SINGULAR, 1), (MemoryError("defect"), 0)]
)
def test_only_ranks_that_all_come_destroy_the_solver(monkeypatch, error, destroyed):
    """After a defect, which may be one rank's own, the others would not come to the collective call."""
    calls = []
    cell = SimpleNamespace(destroy=lambda: calls.append("destroy"))
    monkeypatch.setattr(unit_cell, "tear", lambda case, comm, progress, policy: cell)
    comm = MPI.COMM_SELF
    try:
        with runner._torn(make_case(fibre_fraction=0.4, mesh_size=0.3), comm, Progress(comm, quiet=True)):
            if error is not None:
                raise error
    except (CaseError, ConvergenceError, MemoryError) as caught:
        assert (
            (type(caught) is ConvergenceError and "(singular)" in str(caught)) if error is SINGULAR else caught is error
        )
    assert len(calls) == destroyed


@pytest.mark.parametrize("options", [{}, {"feti_ksp_rtol": 1e-9, "feti_ksp_monitor": False}], ids=str)
def test_a_result_has_the_options_that_change_more_than_the_output(options):
    case = replace(make_case(fibre_fraction=0.4, mesh_size=0.3), petsc=options)
    result = runner.compute(case, MPI.COMM_SELF)
    assert result.solver.options == ({"feti_ksp_rtol": "1e-09"} if options else None)
    assert ("options" in result.document["solver"]) == bool(options)


def test_the_folder_is_held_before_the_work_begins(tmp_path, monkeypatch):
    held = []

    def no_tear(case, comm, progress, policy):
        held.append(file_locks.holder(tmp_path / "out" / output_folder.LOCK))
        raise CaseError("refused")

    monkeypatch.setattr(unit_cell, "tear", no_tear)
    case = make_case(fibre_fraction=0.4, mesh_size=0.3)
    with pytest.raises(CaseError, match="refused"):
        runner.run(case, tmp_path / "out", Progress(MPI.COMM_SELF, quiet=True))
    assert held[0] is not None and not (tmp_path / "out").exists()
    with pytest.raises(CaseError, match="cannot be made"):
        runner.run(case, Path("/proc/results"), Progress(MPI.COMM_SELF, quiet=True))
    assert len(held) == 1
