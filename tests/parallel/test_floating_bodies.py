"""Free fibres: programmes that place them, and forces on fibres that few closed nodes hold."""

import numpy as np
import pytest
from scipy.optimize import OptimizeResult
from support import torn_cells
from support.ranks import assert_certified

from feti_homog import Case, run
from feti_homog.errors import ConvergenceError
from feti_homog.interface.contact.floating_bodies import FloatingBodies
from feti_homog.interface.contact.states import OPEN
from feti_homog.interface.loads import Load

pytestmark = pytest.mark.parallel
ELLIPSES = """x,y,a,b,angle
4.361,0.361,0.515,0.319,116.862
2.391,1.993,0.545,0.355,42.659
4.582,2.302,0.45,0.326,151.444
"""
LEGS = [{"E11": -0.0094, "E22": 0.06605}, {"E11": 0.10553, "gamma12": 0.05519}, {"E11": -0.05934, "gamma12": 0.03638}]


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


@pytest.mark.few_ranks
def test_forces_on_ellipses_that_few_nodes_hold_are_in_balance(comm, shared_path):
    """Influence columns find the multipliers of the last state."""
    if comm.rank == 0:
        (shared_path / "t.csv").write_text(ELLIPSES)
    comm.barrier()
    case = {
        "cell": {"geometry": "table", "file": "t.csv", "width": 5.735, "height": 4.249, "mesh_size": 0.1},
        "material": {"matrix": {"young": 13.55, "poisson": 0.234}, "fibre": {"young": 75.27, "poisson": 0.161}},
        "analysis": {"type": "path", "plane": "stress"},
        "interface": {"normal_strength": 0.637121, "tangential_strength": 0.883686827},
        "path": {"method": "increments", "increments": 8, "waypoints": LEGS},
        "decomposition": {"subdomains": 6},
        "output": {"pictures": False, "mesh_error": False},
    }
    run(Case.parse(case, shared_path), comm, out=shared_path / "out", quiet=True)
    assert_certified(comm, shared_path / "out")
