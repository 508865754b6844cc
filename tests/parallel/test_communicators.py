"""Cases run on any intracommunicator; every other communicator is refused in one line, on every rank."""

import tomllib

import numpy as np
import pytest
from mpi4py import MPI
from support.base_case import changed

from feti_homog import Case, run

pytestmark = pytest.mark.parallel
CASE = Case.parse(tomllib.loads(changed(("mesh_size = 0.05", "mesh_size = 0.3"))))


@pytest.mark.parametrize("kind", ["Cartesian", "graph", "reversed", "alone", "none"])
def test_any_intracommunicator_gives_the_same_stiffness(comm, kind):
    """Rank r of a group runs on 1 - r of 2 ranks; each rank of `MPI.COMM_SELF` runs alone."""
    expected = run(CASE, comm).effective_stiffness
    given = {
        "Cartesian": lambda: comm.Create_cart([comm.size], periods=[True]),
        "graph": lambda: comm.Create_dist_graph_adjacent([comm.rank], [comm.rank]),
        "reversed": lambda: comm.Split(0, -comm.rank),
        "alone": lambda: MPI.COMM_SELF,
        "none": lambda: None,
    }[kind]()
    found = run(CASE, given)
    assert found.solver.ranks == (1 if kind == "alone" else comm.size)
    np.testing.assert_allclose(found.effective_stiffness, expected, rtol=1e-9, atol=1e-9 * expected.max())
    if given not in (None, MPI.COMM_SELF):
        given.Free()


def test_other_communicators_are_refused(comm):
    freed = comm.Dup()
    freed.Free()
    others = [MPI.COMM_NULL, freed, "world", MPI.COMM_WORLD.py2f()]
    if comm.size > 1:
        half = comm.Split(comm.rank % 2, comm.rank)
        others.append(half.Create_intercomm(0, comm, 1 - comm.rank % 2))
    for other in others:
        with pytest.raises(TypeError, match=r"^comm is an intracommunicator of mpi4py, not .{1,80}$"):
            run(CASE, other)
    if comm.size > 1:
        others[-1].Free()
        half.Free()
