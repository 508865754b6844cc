"""A law with memory: bonds whose compliance doubles at the first break and that part at the second."""

from itertools import islice

import numpy as np
import pytest
from mpi4py import MPI
from support import torn_cells
from support.loads import strains
from support.ranks import parallel_assert

from feti_homog.interface.contact.contact_problem import ContactProblem
from feti_homog.interface.contact.coupled_interfaces import CoupledInterfaces
from feti_homog.interface.contact.states import BONDED, BondState
from feti_homog.interface.laws import UTILISATION_TIE
from feti_homog.interface.laws.strength import MaxStrength
from feti_homog.interface.path.path_following import events
from feti_homog.interface.path.path_points import unloaded

pytestmark = pytest.mark.parallel
STIFFNESS = np.array([400.0, 200.0])
# Points of a path that does not end, for lack of memory.
MOST = 300
LEGS = strains(np.array([[1.0, -0.2, 0.4], [0.2, 0.6, 0.4]]))


class TwoSteps(MaxStrength):
    """The history of a bond is how often it broke."""

    def begin(self, k):
        return np.zeros((k, 1))

    def after(self, bonds, which, traction):
        return bonds.history + which[:, None], which & (bonds.history[:, 0] >= 1)

    def softening(self, bonds, pulled):
        return np.repeat(1.0 + np.minimum(bonds.history, 1.0), 3, axis=1)


@pytest.fixture
def path(comm, monkeypatch, request):
    """Return the interfaces, the law and the points of the path."""
    monkeypatch.setattr("feti_homog.homogenization.phase_laws.has_softening", lambda case: True)
    case = {"geometry": "square", "mesh_size": 0.25, "petsc": {"feti_pc_type": request.param}}
    solver = torn_cells.tear(comm, springs=STIFFNESS, **case).solver
    law, k = TwoSteps(30.0, 15.0), len(solver.jump_operator.nodes.row)
    loaded = CoupledInterfaces(ContactProblem(solver, True, np.ones(2), law.softening))
    begin = unloaded(loaded, BondState(np.full(k, BONDED, np.int8), law.begin(k), np.zeros(k, bool)))
    return loaded, law, begin, list(islice(events(loaded, law, LEGS, begin), MOST))


@pytest.mark.parametrize("path", ["dirichlet", "influence"], indirect=True)
def test_bonds_soften_before_they_part(comm, path):
    loaded, law, _, points = path
    softened = parted = 0
    for point in points:
        state, problem = point.state, loaded.plane
        holds, history = state.status == BONDED, state.bonds.history
        traction, jump = problem.traction(state.solution), problem.jump(state.solution)
        springs = STIFFNESS / (1.0 + np.minimum(history, 1.0))
        largest = comm.allreduce(np.abs(traction).max(initial=0.0), MPI.MAX)
        off = np.abs(jump * springs - traction)[holds].max(initial=0.0)
        parallel_assert(comm, state.converged and off < 1e-6 * largest)
        parallel_assert(comm, bool((history[~holds] == 2.0).all() and (history[holds] <= 1.0).all()))
        rise = point.after.bonds.history - history
        used = point.scale * law.share(traction)
        worst = comm.allreduce(used[holds].max(initial=0.0), MPI.MAX)
        parallel_assert(comm, bool((used[rise[:, 0] > 0] >= worst * (1.0 - 2.0 * UTILISATION_TIE)).all()))
        now_parts = rise[:, 0] * history[:, 0]
        assert point.broke == comm.allreduce(now_parts.sum())
        parted, softened = parted + point.broke, softened + comm.allreduce(rise.sum()) - point.broke
        assert point.energies.released >= -1e-12
    assert parted > 2 and softened > parted and len(points) < MOST


@pytest.mark.parametrize("path", ["dirichlet"], indirect=True)
def test_a_path_goes_on_from_what_its_bonds_remember(comm, path):
    loaded, law, _, points = path
    middle = len(points) // 2
    rest = list(islice(events(loaded, law, LEGS, points[middle].after), MOST))
    assert len(rest) == len(points) - middle - 1
    for found, expected in zip(rest, points[middle + 1 :], strict=True):
        assert found.load_factor == pytest.approx(expected.load_factor, rel=1e-7)
        parallel_assert(comm, np.array_equal(found.after.bonds.history, expected.after.bonds.history))
