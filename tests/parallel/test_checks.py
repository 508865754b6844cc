"""Checks of a result that is done: scales that do not vanish, and limits that no option lifts."""

from dataclasses import replace

import numpy as np
import pytest
from support import torn_cells
from support.cases import make_case
from support.ranks import parallel_assert, write_once
from unit.mesh.faulty_meshes import grid

from feti_homog.analysis import path as load_path
from feti_homog.analysis.context import AnalysisContext, CellLoads
from feti_homog.case.load_sections import LoadPath
from feti_homog.errors import CaseError, ConvergenceError
from feti_homog.interface.contact.states import OPEN
from feti_homog.interface.laws.strength import MaxStrength
from feti_homog.system.petsc.options_database import case_options
from feti_homog.system.runtime.standard_streams import Progress

pytestmark = pytest.mark.parallel


class Words(Progress):
    """Keeps the lines."""

    def __init__(self, comm):
        super().__init__(comm, quiet=True)
        self.lines = []

    def say(self, words):
        self.lines.append(words)


def context_of(comm, cell, contact=True):
    return replace(AnalysisContext.of(cell, Words(comm)), loads=CellLoads(cell, contact))


@pytest.mark.parametrize("contact", [True, False])
def test_hill_holds_where_a_debonded_cell_stores_nothing(comm, shared_path, contact):
    """A strip across the cell that has come off: no stress under tension across it, nor under shear."""
    write_once(comm, grid(lambda x, y: abs(x - 0.5) < 0.25), shared_path / "strip.msh")
    cell = torn_cells.tear(comm, geometry="mesh", file="strip.msh", folder=shared_path)
    context = context_of(comm, cell, contact)
    status = np.full(len(cell.solver.jump_operator.nodes.row), OPEN, np.int8)
    responses = context.plane.respond(np.eye(3), torn_cells.bonds(status), context.loads.zero_multipliers())
    for response in responses:
        context.checks.record("strip", response)
    for k in (0, 2):
        assert np.abs(responses[k].stress).max() < 1e-12 * responses[1].stress[1]
    assert not context.checks.faults
    comm.barrier()


def test_jumps_are_reported_on_the_scale_on_which_they_are_checked(comm):
    cell = torn_cells.tear(comm, geometry="square", mesh_size=0.3)
    context = context_of(comm, cell)
    (response,) = context.plane.respond(np.eye(3)[:1], context.bonds(None), context.loads.zero_multipliers()[:1])
    # Where the forces vanish the torn cell's jump does, too, and relative to it any jump is large.
    solution = replace(response.state.solution, residual=2.7e-5, reason=-3)
    loose = replace(response, state=replace(response.state, solution=solution))
    line, words = context.checks.record("E11", loose), f"relative jump {response.checks['jump']:.1e}"
    parallel_assert(comm, words in line and "2.7e-05" not in line)
    parallel_assert(comm, len(context.checks.faults) == 1 and words in context.checks.faults[0])


@pytest.mark.parametrize(("rtol", "limit"), [(1e-10, 1e-7), (1e-7, 1e-4), (1e-3, 1e-4), (0.5, 1e-4)])
def test_no_tolerance_lifts_the_limit_of_the_checks(comm, rtol, limit):
    cell = torn_cells.tear(comm, geometry="square", mesh_size=0.3, petsc={"feti_ksp_rtol": rtol})
    context = context_of(comm, cell)
    for law in ("hill", "jump", "strain", "symmetry"):
        assert context.checks.tolerance(law) == pytest.approx(limit)
    assert context.checks.tolerance("kkt_tension") == 1e-6
    assert bool(context.warnings()) == (rtol > 1e-7)
    context.checks.require("E11", {"hill": 1.1 * limit})
    assert len(context.checks.faults) == 1


def test_what_is_no_number_is_within_no_tolerance(comm):
    context = context_of(comm, torn_cells.tear(comm, geometry="square", mesh_size=0.3))
    context.checks.require("E11", {"hill": np.nan})
    assert len(context.checks.faults) == 1 and "check hill: nan" in context.checks.faults[0]


@pytest.mark.parametrize("method", ["events", "increments"])
def test_a_path_whose_solve_breaks_down_is_no_result(comm, monkeypatch, method):
    cell = torn_cells.tear(comm, geometry="square", mesh_size=0.3)
    path = LoadPath(strain=(1.0, 0.0, 0.0), method=method, increments=3)
    context = context_of(comm, replace(cell, case=replace(cell.case, path=path)))
    monkeypatch.setattr(load_path, "criterion_of", lambda *_, **__: MaxStrength(10.0, 10.0))
    solve = cell.solver.solve

    def broken_down(strain, start):
        return replace(solve(strain, start), residual=np.nan, reason=-9)

    monkeypatch.setattr(cell.solver, "solve", broken_down)
    with pytest.raises(ConvergenceError, match="broke down after"):
        load_path.run(context)


@pytest.mark.parametrize("rtol", [2.0, 1, 0, -1e-8, "small", "nan"])
def test_tolerances_that_are_none_are_refused(rtol):
    case = make_case(petsc={"feti_ksp_rtol": rtol})
    with (
        pytest.raises(CaseError, match=f"^-feti_ksp_rtol {rtol}: expected a number above 0 and below 1$"),
        case_options(case.petsc),
    ):
        pass
