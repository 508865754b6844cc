"""Linear programmes that place free fibres: when one is not solved, every rank hears of it."""

import numpy as np
import pytest
from scipy.optimize import OptimizeResult
from support import torn_cells

from feti_homog.errors import ConvergenceError
from feti_homog.interface.contact.floating_bodies import FloatingBodies
from feti_homog.interface.contact.states import OPEN
from feti_homog.interface.loads import Load

pytestmark = pytest.mark.parallel


def unsolved(*_, **__):
    return OptimizeResult(x=None, success=False, status=4, message="Numerical difficulties were encountered.")


def test_an_unsolved_programme_is_raised_on_every_rank(comm, monkeypatch):
    cell = torn_cells.tear(comm, geometry="square", mesh_size=0.3)
    status = np.full(len(cell.solver.jump_operator.nodes.row), OPEN, np.int8)
    interface, start = torn_cells.interface(cell, True), np.zeros(cell.solver.rows)
    monkeypatch.setattr("scipy.optimize.linprog", unsolved)
    with pytest.raises(ConvergenceError, match="not solved: Numerical difficulties"):
        interface.equilibrium(Load.strain(np.array([-1.0, -1.0, 0.0])), torn_cells.bonds(status), start)
    nodes, gap = interface.nodes, np.ones(len(status))
    with pytest.raises(ConvergenceError, match="not solved: Numerical difficulties"):
        FloatingBodies(comm, cell.solver.natural, nodes, status == OPEN, 1e-9).admissible_share(gap, -gap)
