"""The torn cell and the folder of a run that ends early, options of a result, and the line on a load that falls."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI
from support.cases import case_of, make_case

from feti_homog.analysis import runner
from feti_homog.errors import CaseError, ConvergenceError
from feti_homog.homogenization import unit_cell
from feti_homog.results import output_folder
from feti_homog.system.runtime import file_locks
from feti_homog.system.runtime.standard_streams import Progress

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


@pytest.mark.parametrize("to", [{"S22": 100.0}, {"S11": -1.0, "S22": 90.0}, {"E22": 0.01}])
def test_a_load_that_falls_from_its_largest_value_has_one_line(to, tmp_path, monkeypatch):
    cohesive = {"law": "bilinear", "normal_stiffness": 1e5, "tangential_stiffness": 1e5, "normal_toughness": 0.02}
    cohesive |= {"normal_strength": 60.0, "tangential_strength": 85.0, "tangential_toughness": 0.04}
    case = case_of(
        {"geometry": "square", "fibre_fraction": 0.4, "mesh_size": 0.15},
        material={"matrix": {"young": 4e3, "poisson": 0.35}, "fibre": {"young": 7e4, "poisson": 0.2}},
        interface=cohesive,
        path={"to": to, "max_events": 100},
    )
    lines = []
    monkeypatch.setattr(Progress, "say", lambda self, line: lines.append(line))
    result = runner.run(case, tmp_path / "out", Progress(MPI.COMM_SELF, True))
    printed = [line for line in lines if "largest value so far" in line]
    if "E22" in to:  # the strain prescribes where the path ends
        assert printed == [] and not any("jumps" in line for line in result.remarks)
        return
    load = [point.load_factor for point in result.path]
    first = next(k for k in range(len(load)) if load[k] < 0.95 * max(load[: k + 1]))
    top = max(result.path[:first], key=lambda point: point.load_factor)
    (line,) = printed
    place = f"at {top.load_factor:.6f}, E22 {top.strain[1]:.4g}, S22 {top.stress[1]:.4g}"
    assert f"{place}; the path ends at load factor 1" in line and "prescribed strain" in line
    assert f"[path] under a load that only rises, the strain jumps {place}" in result.remarks
