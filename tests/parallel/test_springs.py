"""Elastic interfaces: published numbers, exact relations, quadratic programming, limits; at any number of ranks."""

import numpy as np
import pytest
from mpi4py import MPI
from reference import dense_feti
from reference.references import BONDED as GLUED
from reference.references import ELASTIC, VOID
from scipy.sparse import identity
from support import torn_cells
from support.cases import FIBRE, MATRIX, relative_error
from support.random_cells import random_bonded, random_cell, random_strain

from feti_homog.homogenization.averaging import Homogenization
from feti_homog.interface.contact.states import BONDED, CLOSED, OPEN
from feti_homog.interface.loads import Load

pytestmark = [pytest.mark.parallel, pytest.mark.few_ranks]

UNIT = np.eye(3)
PIECES = [{}, {"subdomains": 12}]


def bonded_responses(cell):
    """Return the responses to the unit strains with all bonds intact."""
    status = np.full(len(cell.solver.jump_operator.nodes.row), BONDED, np.int8)
    return Homogenization(cell, True).respond(UNIT, torn_cells.bonds(status), [np.zeros(cell.solver.rows)] * 3)


def stiffness(comm, **case):
    """L^ef (3, 3), the largest error of a check, and the largest number of iterations."""
    responses = bonded_responses(torn_cells.tear(comm, **case))
    L = np.array([response.stress for response in responses]).T
    return L, max(max(r.checks.values()) for r in responses), max(r.state.iterations for r in responses)


def errors(comm, key, **mesh):
    """(3,) relative errors of C11, C12 and C33."""
    geometry, *springs = key
    L, worst, _ = stiffness(comm, geometry=geometry, springs=springs, **mesh)
    assert worst < 1e-5
    return np.abs(L[[0, 0, 2], [0, 1, 2]] / ELASTIC[key].value - 1)


@pytest.mark.one_rank
@pytest.mark.parametrize("key", ELASTIC, ids=str)
def test_curved_elements_reach_the_published_numbers(comm, key):
    # The softer the springs, the more of the strain is theirs.
    refine = 3 if key[1] == 10 else 2
    assert errors(comm, key, order=2, mesh_size=0.1, refine=refine).max() < 2e-6


def solutions(cell, solver, compliance):
    """Multipliers and jumps under the unit strains with all bonds but every seventh of this rank, and iterations."""
    nodes = solver.jump_operator.nodes
    active = np.ones(solver.rows)
    active[nodes.row[::7]] = active[nodes.row[::7] + 1] = 0.0
    solver.set_state(active, compliance)
    found = solver.solve_many(UNIT, np.zeros((solver.rows, 3)))
    parts = [[f.lam for f in found], [f.jump + f.compliance * f.lam for f in found]]
    return [np.hstack(cell.comm.allgather(np.stack(part))) for part in parts], found[0].iterations


@pytest.mark.parametrize("preconditioner", ["dirichlet", "influence", "lumped"])
@pytest.mark.parametrize("pieces", PIECES, ids=["whole", "cut"])
def test_springs_that_soften_are_those_that_were_soft_from_the_beginning(comm, monkeypatch, preconditioner, pieces):
    """Springs of twice the compliance, set after a solve with the first; then all as at first."""
    case = {
        "geometry": "hexagonal",
        "mesh_size": 0.2,
        "decomposition": pieces,
        "petsc": {"feti_pc_type": preconditioner},
    }
    soft = torn_cells.tear(comm, springs=(200.0, 100.0), **case).solver
    # The exact inverse follows any springs; where fibres are cut the preconditioner may be one with springs.
    if not pieces and preconditioner != "influence":
        with pytest.raises(ValueError, match="expected constant compliance"):
            soft.set_state(np.ones(soft.rows), 2 * soft.intact_compliance)
    monkeypatch.setattr("feti_homog.homogenization.phase_laws.has_softening", lambda case: True)
    cell = torn_cells.tear(comm, springs=(400.0, 200.0), **case)
    first = solutions(cell, cell.solver, cell.solver.intact_compliance)
    np.testing.assert_allclose(2 * cell.solver.intact_compliance, soft.intact_compliance, rtol=1e-14)
    expected = solutions(cell, soft, soft.intact_compliance)
    for compliance, (wanted, iterations) in (
        (soft.intact_compliance, expected),
        (cell.solver.intact_compliance, first),
    ):
        found, needed = solutions(cell, cell.solver, compliance)
        assert max(map(relative_error, found, wanted)) < 1e-6
        # The exact inverse follows; of the others the update is as good as theirs.
        assert needed <= (1 if preconditioner == "influence" else iterations + 2)


@pytest.mark.quick
@pytest.mark.parametrize("pieces", PIECES, ids=["whole", "cut"])
@pytest.mark.parametrize("preconditioner", ["dirichlet", "influence"])
def test_iterations_hardly_depend_on_the_springs(comm, preconditioner, pieces):
    case = {"geometry": "hexagonal", "mesh_size": 0.1, "order": 2, "decomposition": pieces}
    case["petsc"] = {"feti_pc_type": preconditioner, "feti_dual_operator": "explicit"}
    glued, _, few = stiffness(comm, **case)
    last = glued
    for k in (1e12, 1e2, 0.1):
        L, worst, iterations = stiffness(comm, springs=(k, k / 4), **case)
        assert worst < 1e-5 and iterations <= max(2 * few, 1 + few)
        assert (np.linalg.eigvalsh(last - L) > -1e-9 * np.abs(L).max()).all()
        if k == 1e12:
            assert relative_error(L, glued) < 1e-8
        last = L
    assert last[0, 0] == pytest.approx(VOID["hexagonal"].value[0], rel=0.01)


@pytest.mark.one_rank
def test_a_neutral_fibre_is_not_seen(comm):
    """2 / (k_n a) = 1 / k_m - 1 / k_f gives the bulk modulus of the matrix in any arrangement."""
    bulk = [phase["young"] / (2 * (1 + phase["poisson"]) * (1 - 2 * phase["poisson"])) for phase in (MATRIX, FIBRE)]
    case = {"geometry": "random", "fibres": 4, "min_gap": 0.1, "seed": 2, "fibre_fraction": 0.35}
    radius = np.sqrt(0.35 / (4 * np.pi))
    normal = 2 / radius / (1 / bulk[0] - 1 / bulk[1])
    L, worst, _ = stiffness(comm, mesh_size=0.1, refine=1, order=2, springs=(normal, 0.3 * normal), **case)
    assert (L[0, 0] + 2 * L[0, 1] + L[1, 1]) / 4 == pytest.approx(bulk[0], rel=2e-6)
    assert worst < 1e-5


@pytest.mark.one_rank
@pytest.mark.parametrize("number", range(2))
def test_random_cells_equal_the_quadratic_programme(comm, number):
    rng = np.random.default_rng([comm.size, number, 7])
    springs = tuple(10.0 ** rng.uniform(-2, 3, size=2))
    pc = ("dirichlet", "influence")[number % 2]
    case = torn_cells.build(comm, springs=springs, **random_cell(rng), petsc={"feti_pc_type": pc})
    for _ in range(3):
        bonded, strain = random_bonded(rng, case.reference) if case.reference else None, None
        bonded, strain = comm.bcast((bonded, random_strain(rng)))
        contact = bool(comm.bcast(rng.random() < 0.85))
        interface = case.interface(contact)
        state = interface.equilibrium(Load.strain(strain), torn_cells.bonds(case.status(bonded)), case.start())
        assert state.solution.reason > 0 and max(state.certificate.values()) < 1e-9
        expected = comm.bcast(case.reference and case.reference.solve_elastic(strain, bonded, contact, springs))
        assert relative_error(torn_cells.stress(case.cell, state.solution), expected.stress) < 1e-7
        stored = strain @ torn_cells.stress(case.cell, state.solution) * case.cell.summary.area / 2
        assert abs(stored - expected.energy) < 1e-7 * expected.energy
        largest = np.abs(expected.u).max() + np.abs(strain).max()
        jump = case.in_reference_order(interface.jump(state.solution))
        status = case.in_reference_order(state.status)
        held = bonded | ((status == CLOSED) & expected.closed)
        assert np.abs(jump[held] - expected.jump[held])[:, 0].max(initial=0.0) < 1e-6 * largest
        if contact:
            assert (jump[status == OPEN, 0] > -1e-7 * largest).all()


def test_one_stiffness_alone_may_be_finite(comm):
    case = {"geometry": "square", "mesh_size": 0.1, "order": 2}
    glued = GLUED["square", "strain"].value
    sliding, *_ = stiffness(comm, springs=(None, 1e-6), **case)
    stiff, *_ = stiffness(comm, springs=(1e12, 1e-6), **case)
    assert relative_error(sliding, stiff) < 1e-7
    assert VOID["square"].value[0] < sliding[0, 0] < glued[0] and sliding[2, 2] < glued[2]


@pytest.mark.parametrize("dual_operator", ["explicit", "implicit"])
def test_the_softest_springs_leave_a_hole(comm, dual_operator):
    """In few iterations, unless there are so many ranks that the matrix is cut."""
    case = {"geometry": "hexagonal", "petsc": {"feti_dual_operator": dual_operator}}
    (soft, worst, few), (softer, *_) = (stiffness(comm, springs=(k, k), **case) for k in (1e-18, 1e-9))
    assert relative_error(soft, softer) < 1e-8 and worst < 1e-5 and (few < 20 or comm.size > 3)


# What the preconditioner takes for the springs.

CUT = {"geometry": "hexagonal", "mesh_size": 0.12, "refine": 1, "decomposition": {"subdomains": 24}}


@pytest.mark.parametrize("springs", [(5.0, 2.0), (1e-13, 4e-14)], ids=str)
@pytest.mark.parametrize("kind", ["explicit", "implicit"])
def test_the_flexibility_with_springs_is_a_generalized_inverse_of_its_stiffness(comm, kind, springs):
    """S~ (S+ + C) S~ = S~, S~ R = 0, and S+ + C is symmetric."""
    cell = torn_cells.tear(comm, springs=springs, geometry="hexagonal", petsc={"feti_dual_operator": kind})
    operators, found = cell.solver.interface_operators, 0
    bodies = zip(cell.subdomains, operators.dofs, operators.operators, operators.with_springs, strict=True)
    for subdomain, dofs, body, sprung in bodies:
        if sprung is not body:
            unit = np.asfortranarray(np.eye(len(dofs)))
            S, flexibility = sprung.apply_schur(unit), sprung.apply_flexibility(unit)
            assert np.abs(S @ flexibility @ S - S).max() < 1e-9 * np.abs(S).max()
            assert np.abs(sprung.apply_schur(np.asfortranarray(subdomain.R[dofs]))).max() < 1e-12 * np.abs(S).max()
            if kind == "explicit":
                regular = S + sprung.regularisation(identity(len(dofs), format="csr"))
                assert np.linalg.cond(regular) < 1e4
            assert np.abs(flexibility - flexibility.T).max() < 1e-9 * np.abs(flexibility).max()
            found += 1
    assert comm.allreduce(found) > 0


@pytest.mark.parametrize("space", ["natural", "adaptive"])
def test_the_preconditioner_is_no_less_than_the_inverse_with_springs(comm, space):
    """Eigenvalues of H (F + C) are 1 at least, also where fibre and matrix are both cut."""
    cell = torn_cells.tear(comm, springs=(50.0, 20.0), **CUT, petsc={"feti_coarse_space": space})
    assert comm.allreduce(cell.solver.interface_operators.compliance.any(), MPI.LOR)
    H, F = (dense_feti.matrix(cell, f) for f in (cell.solver.preconditioner.apply, cell.solver.operator.apply))
    P = dense_feti.projector(dense_feti.gathered(cell, cell.solver.natural.G.toarray()))
    least, largest = dense_feti.extreme_eigenvalues(F, P @ H @ P)
    assert least > 1 - 1e-6
    assert largest < (20 if space == "adaptive" else np.inf)
