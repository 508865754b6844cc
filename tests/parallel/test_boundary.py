"""The subdomains through their boundaries: extension, loads, kinds of operators and the default pieces."""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI
from reference.dense_feti import DenseDual, gathered, matrix, projector
from support import torn_cells
from support.cases import make_case, relative_error

from feti_homog.case import sections
from feti_homog.errors import CaseError
from feti_homog.feti.operators.one_subdomain import ExplicitInterfaceOperator, ImplicitInterfaceOperator
from feti_homog.feti.solver_plan import BONDED, PRECONDITIONERS, construct
from feti_homog.feti.thresholds import Thresholds
from feti_homog.homogenization import unit_cell
from feti_homog.homogenization.partition_policy import PartitionPolicy, wanted_pieces
from feti_homog.mesh.refinement import ReferenceLattice
from feti_homog.system.runtime.standard_streams import Progress

pytestmark = pytest.mark.parallel

SMALL_DENSE = Thresholds(dense_boundary_dofs=10)
RANDOM = {"geometry": "random", "fibres": 5, "fibre_fraction": 0.45, "min_gap": 0.1, "seed": 3}
OPERATORS = {"implicit": ImplicitInterfaceOperator, "explicit": ExplicitInterfaceOperator}
CELLS = pytest.mark.parametrize(
    "case",
    [
        {"geometry": "hexagonal"},
        {"geometry": "hexagonal", "order": 2, "mesh_size": 0.25, "decomposition": {"subdomains": 8}},
        RANDOM | {"bodies": "plane", "mesh_size": 0.25},
        RANDOM | {"decomposition": {"subdomains": 12}},
    ],
    ids=["whole", "quadratic", "plane", "cut"],
)


@CELLS
@pytest.mark.parametrize(("kind", "operators"), OPERATORS.items(), ids=OPERATORS)
def test_torn_cell_equals_the_dense_one(comm, case, kind, operators):
    """P d, P^T F P and the torn cell's stiffness do not depend on the generalized inverse."""
    cell = torn_cells.tear(comm, **case, petsc={"feti_dual_operator": kind})
    dense, solver = DenseDual(cell), cell.solver
    assert all(isinstance(o, operators) for o in solver.interface_operators.operators)
    P = projector(dense.G)
    F = matrix(cell, solver.operator.apply)
    assert relative_error(P @ F @ P, P @ dense.F @ P) < 1e-10
    own_jump, own_stiffness = np.zeros((dense.total, 3)), np.zeros((3, 3))
    for s, first in zip(cell.subdomains, cell.offsets, strict=False):
        u = np.linalg.pinv(s.assemble_stiffness().toarray(), rcond=1e-10, hermitian=True) @ -s.Q
        own_jump[solver.jump_operator.rows] += solver.jump_operator.B[:, first : first + len(u)] @ u
        own_stiffness += s.area * s.L + s.Q.T @ u
    jump = P @ comm.allreduce(own_jump)
    assert relative_error(P @ gathered(cell, solver.d), jump) < 1e-10
    # Free pieces take the strain off: then it vanishes.
    mean = comm.allreduce(sum((s.area * s.L for s in cell.subdomains), np.zeros((3, 3))))
    assert np.abs(solver.torn_stiffness - comm.allreduce(own_stiffness)).max() < 1e-10 * mean.max()


@CELLS
def test_preconditioner_equals_the_dense_one(comm, case):
    cell = torn_cells.tear(comm, **case, petsc={"feti_coarse_space": "natural"})
    active = np.ones(cell.solver.jump_operator.global_rows, bool)
    expected = DenseDual(cell).preconditioner(active)
    assert relative_error(matrix(cell, cell.solver.preconditioner.apply), expected) < 1e-11


def test_adaptive_space_is_refused_where_boundaries_are_too_large(comm):
    case = {"geometry": "hexagonal", "decomposition": {"subdomains": 8}}
    assert torn_cells.tear(comm, **case, thresholds=SMALL_DENSE).solver.adaptive is None
    with pytest.raises(CaseError, match="-feti_coarse_space adaptive: needs"):
        torn_cells.tear(comm, **case, petsc={"feti_coarse_space": "adaptive"}, thresholds=SMALL_DENSE)


# Pieces of 100 dofs; bodies are cut above 250 dofs, or 80 of the boundary where bonds break.
SMALL_PIECES = PartitionPolicy(piece_dofs=100, breakable_boundary_dofs=80)


def wanted(load, edges, interface=None, n_ranks=1, refine=0, policy=SMALL_PIECES):
    """Default pieces of bodies of so many triangles and outer edges."""
    case, lattice = (
        replace(make_case(refine=refine), interfaces=() if interface is None else (interface,)),
        ReferenceLattice.of(refine, 1),
    )
    return wanted_pieces(case, np.array(load), np.array(edges), lattice, n_ranks, policy).tolist()


def test_pieces_follow_loads_ranks_and_boundaries():
    assert wanted([240, 260, 30, 1000], [90, 10, 10, 10]) == [1, 3, 1, 10]
    # Four elements a triangle.
    assert wanted([60, 65], [10, 10], refine=1) == [1, 3]
    assert wanted([5000], [10]) == [50]
    assert wanted([20_000, 30], [10, 10]) == [200, 1]
    load, edges = [600] * 100 + [1700], [10] * 101
    assert wanted(load, edges) == [1] * 100 + [17]
    assert wanted(load, edges, n_ranks=16) == [6] * 100 + [17]
    assert wanted([600] * 2, [400, 800]) == [6, 6]
    bonds_break = sections.InterfaceSection()
    assert wanted([260, 3000, 260], [10, 39, 41], bonds_break) == [1, 1, 3]
    assert wanted([70, 70], [19, 21], bonds_break, refine=1) == [1, 3]


@pytest.mark.parametrize("interface", [None, sections.InterfaceSection()])
def test_every_rank_has_a_piece(interface):
    assert wanted([200, 40], [10, 10], interface, n_ranks=2) == [1, 1]
    assert wanted([200, 40], [10, 10], interface, n_ranks=5) == [4, 1]
    assert wanted([260, 70], [10, 41], n_ranks=3) == [3, 1]


def torn_by_default(comm, interface, policy=SMALL_PIECES):
    """Return a cell of two fibres and a matrix; the bodies of its pieces and the triangles of the largest piece."""
    case = replace(make_case(geometry="hexagonal", mesh_size=0.1), interfaces=() if interface is None else (interface,))
    cell = unit_cell.tear(case, comm, Progress(comm, quiet=True), policy=policy)
    own = comm.allgather([s.submesh.body for s in cell.subdomains])
    largest = comm.allreduce(max((len(s.submesh.triangles) for s in cell.subdomains), default=0), MPI.MAX)
    assert min(map(len, own)) > 0
    return cell, sorted(body for bodies in own for body in bodies), largest


@pytest.mark.parametrize("case", [{"geometry": "square"}, RANDOM, RANDOM | {"bodies": "plane", "mesh_size": 0.25}])
def test_default_pieces_give_every_rank_one(comm, torn, case):
    cell = torn(**case)
    assert min(comm.allgather(len(cell.subdomains))) > 0
    assert cell.summary.subdomains == max(cell.summary.bodies, comm.size)


def test_default_pieces_of_a_bonded_cell_are_small(comm):
    cell, bodies, largest = torn_by_default(comm, None)
    assert len(bodies) > 4
    assert largest < 1.5 * 100
    assert cell.solver.adaptive is not None


def test_default_pieces_of_a_debonding_cell_are_bodies_unless_wide(comm):
    whole = replace(SMALL_PIECES, breakable_boundary_dofs=1000)
    cell, bodies, largest = torn_by_default(comm, sections.InterfaceSection(), whole)
    assert len(bodies) == max(3, comm.size)
    assert (cell.solver.adaptive is not None) == (comm.size > 3)
    cell, bodies, narrowed = torn_by_default(comm, sections.InterfaceSection())
    assert len(bodies) > 4
    assert narrowed < min(largest, 1.5 * 100)


def test_every_preconditioner_is_constructed(torn):
    operators = torn(petsc={"feti_dual_operator": "explicit"}, geometry="hexagonal").solver.interface_operators
    names = sorted({*PRECONDITIONERS, BONDED} - {"auto"})
    assert len({type(construct(name, operators)) for name in names}) == len(names)
