"""Fixtures of the tests under mpirun."""

import sys
from functools import partial

import pytest


@pytest.fixture(scope="session", autouse=True)
def agreement_is_silent():
    """On several ranks what `agree` calls fails where it communicates; what rank 0 alone calls would hang there."""
    from collective_calls import no_communication
    from mpi4py import MPI

    from feti_homog.system.parallel import mpi_errors

    attempt = mpi_errors._attempt

    def watched(function, *args, **kwargs):
        is_agreed = sys._getframe(1).f_code is mpi_errors.agree.__code__
        return attempt(no_communication()(function) if is_agreed else function, *args, **kwargs)

    with pytest.MonkeyPatch.context() as patch:
        if MPI.COMM_WORLD.size > 1:
            patch.setattr(mpi_errors, "_attempt", watched)
        yield


@pytest.fixture(scope="module")
def narrow():
    """Provide the narrow cell."""
    from support.coarse_space_cells import Narrow

    cell = Narrow()
    yield cell
    cell.solver.destroy()


@pytest.fixture
def strip(comm, shared_path):
    """Provide a folder with the mesh of a strip of fibre normal to x1."""
    from support.ranks import write_once
    from unit.mesh.faulty_meshes import grid

    write_once(comm, grid(lambda x, y: 0.25 < x < 0.5), shared_path / "strip.msh")
    return shared_path


@pytest.fixture
def shared_interfaces(comm, monkeypatch):
    """Assert that no rank of several owns all interface nodes of a cell that the test makes on all ranks."""
    from feti_homog.feti.decomposition.jump_operator import JumpOperator

    made, make = [], JumpOperator.__init__

    def counted(self, ranks, *arguments):
        make(self, ranks, *arguments)
        made.append((ranks.size, len(self.nodes.row)))

    monkeypatch.setattr(JumpOperator, "__init__", counted)
    yield
    owned = comm.allgather([nodes for ranks, nodes in made if ranks == comm.size])
    for cell in zip(*owned, strict=True):
        owners = sum(nodes > 0 for nodes in cell)
        assert comm.size == 1 or owners != 1, f"interface nodes of ranks: {cell}"


@pytest.fixture(scope="module")
def torn():
    """torn(**case): the torn cell of a case, made at the first call of the module and shared by its tests."""
    from support import torn_cells

    made = {}
    yield partial(_made, made, torn_cells.tear)
    for cell in made.values():
        cell.solver.destroy()


@pytest.fixture(scope="module")
def built():
    """built(**case): the same, with its quadratic programme."""
    from support import torn_cells

    made = {}
    yield partial(_made, made, torn_cells.build)
    for referenced in made.values():
        referenced.cell.solver.destroy()


def _made(made, make, **case):
    """make(all ranks, **case), once for each case.  Collective."""
    from mpi4py import MPI

    key = repr(sorted(case.items()))
    if key not in made:
        made[key] = make(MPI.COMM_WORLD, **case)
    return made[key]
