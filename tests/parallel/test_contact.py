"""Debonding and contact against quadratic programming, published numbers and laws, at any number of ranks."""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI
from reference.references import ARC_OF_120_DEGREES, ARC_OF_120_DEGREES_FINE
from support import torn_cells
from support.cases import relative_error
from support.random_cells import random_bonded, random_cell, random_strain
from support.ranks import parallel_assert

from feti_homog.case.interface_section import Arc
from feti_homog.interface.contact.states import BONDED, CLOSED, OPEN
from feti_homog.interface.loads import Load

pytestmark = pytest.mark.parallel

EQUAL = 1e-7
CERTIFIED = 1e-9
CASES_OF_A_CELL = 4
MOST_SOLVES = 50
STRAINS = np.eye(3)


def directions(cell):
    """Degrees of this rank's interface nodes about their fibre's centre."""
    normal = cell.solver.jump_operator.nodes.normal
    return np.degrees(np.arctan2(normal[:, 1], normal[:, 0]))


def response(cell, contact, strain, status):
    """Sigma and the equilibrium from the multipliers zero."""
    state = torn_cells.interface(cell, contact).equilibrium(
        Load.strain(np.array(strain, float)), torn_cells.bonds(status), np.zeros(cell.solver.rows)
    )
    return torn_cells.stress(cell, state.solution), state


def stiffness(cell, status):
    """Return the stiffness without contact."""
    return np.array([response(cell, False, strain, status)[0] for strain in STRAINS]).T


@pytest.mark.parametrize("number", range(8))
def test_random_cells_equal_the_quadratic_programme(comm, number):
    # Other cells on other numbers of ranks: 60 cases at 1, 2 and 4.
    rng = np.random.default_rng([comm.size, number])
    pc = ("dirichlet", "influence")[number % 2]
    case = torn_cells.build(comm, **random_cell(rng), petsc={"feti_pc_type": pc})
    for _ in range(CASES_OF_A_CELL):
        bonded, strain = random_bonded(rng, case.reference) if case.reference else None, None
        bonded, strain = comm.bcast((bonded, random_strain(rng)))
        contact = bool(comm.bcast(rng.random() < 0.85))
        stress, state = response(case.cell, contact, strain, case.status(bonded))
        energy = torn_cells.energy(case.cell, state.solution)
        assert state.solution.reason > 0
        assert state.solves < MOST_SOLVES
        assert max(state.certificate.values()) < CERTIFIED
        expected = comm.bcast(case.reference and case.reference.solve(strain, bonded, contact))
        assert abs(energy - expected.energy) < EQUAL * expected.energy
        assert relative_error(stress, expected.stress) < EQUAL
        status = case.in_reference_order(state.status)
        assert ((status == BONDED) == bonded).all()
        if contact:
            tight = expected.force[:, 0] < -1e-6 * np.abs(expected.stress).max()
            assert (status[tight & ~bonded] == CLOSED).all()


@pytest.mark.quick
def test_debonded_fibre_with_contact_is_a_void_under_tension(comm):
    cell = torn_cells.tear(comm, geometry="square", order=2, mesh_size=0.2)
    status = np.full(len(directions(cell)), OPEN, np.int8)
    stress, state = response(cell, True, [1, 0, 0], status)
    assert relative_error(stress, stiffness(cell, status)[:, 0]) < 1e-9
    assert comm.allreduce(int((state.status != OPEN).sum())) == 0


def arc_of_120_degrees(comm, **case):
    """(6,) C11, C22, C12, C33 with faces free, and S11, S22 with contact under E11 = -1; degrees of freedom."""
    cell = torn_cells.tear(comm, [Arc(fibre="all", angle=120.0)], geometry="square", **case)
    status = np.where(np.abs(directions(cell)) < 60 - 1e-6, OPEN, BONDED).astype(np.int8)
    L, pressed = stiffness(cell, status), response(cell, True, [-1, 0, 0], status)[0]
    return np.array([L[0, 0], L[1, 1], L[0, 1], L[2, 2], pressed[0], pressed[1]]), cell.comm.allreduce(
        sum(s.n_dofs for s in cell.subdomains)
    )


@pytest.mark.one_rank
def test_an_arc_of_120_degrees_has_the_reference_stiffness(comm):
    found, _ = arc_of_120_degrees(comm, order=2, mesh_size=0.1, refine=1)
    assert np.abs(found / ARC_OF_120_DEGREES.value - 1).max() < 2e-4
    assert np.abs(np.array(ARC_OF_120_DEGREES_FINE.value) / ARC_OF_120_DEGREES.value - 1).max() < 5e-4


@pytest.mark.one_rank
@pytest.mark.parametrize(
    ("mesh", "dofs", "error"),
    [
        ({"order": 2, "mesh_size": 0.05}, 13_500, 2.5e-4),
        ({"order": 2, "mesh_size": 0.07, "refine": 1}, 28_500, 3e-5),
        ({"order": 1, "mesh_size": 0.05, "refine": 2}, 28_500, 2e-3),
    ],
)
def test_meshes_are_graded_at_tips(comm, mesh, dofs, error):
    found, taken = arc_of_120_degrees(comm, **mesh)
    assert np.abs(found / ARC_OF_120_DEGREES_FINE.value - 1).max() < error and taken < dofs


@pytest.mark.one_rank
@pytest.mark.parametrize(("order", "rate"), [(1, 1.7), (2, 3.0)])
def test_arcs_converge_as_bonded_cells_do(comm, order, rate):
    """Without grading the rate is 1, whatever the order."""
    errors = [
        np.abs(
            arc_of_120_degrees(comm, order=order, mesh_size=0.1, refine=refine)[0] / ARC_OF_120_DEGREES_FINE.value - 1
        )
        for refine in (0, 1)
    ]
    assert np.log2(errors[0].max() / errors[1].max()) > rate
    of_one_size = [
        arc_of_120_degrees(comm, order=order, mesh_size=0.1, tip_size=0.1, refine=refine)[0] for refine in (0, 1)
    ]
    errors = [np.abs(found / ARC_OF_120_DEGREES_FINE.value - 1).max() for found in of_one_size]
    assert 0.8 < np.log2(errors[0] / errors[1]) < 1.3


@pytest.mark.parametrize("order", [1, 2])
def test_masked_rows_equal_constraints_built_without_them(comm, order):
    """The paper's first way against its second: the saddle-point problem of B without the debonded rows, dense."""
    pieces, tight = {"subdomains": 6}, {"feti_ksp_rtol": 1e-13}
    cell = torn_cells.tear(
        comm, geometry="hexagonal", order=order, mesh_size=0.25 * order, decomposition=pieces, petsc=tight
    )
    interface = torn_cells.interface(cell, False)
    status = np.where(np.abs(directions(cell) - 30) < 50, OPEN, BONDED).astype(np.int8)
    active = np.concatenate(comm.allgather(interface.active(status))) > 0
    solver = cell.solver
    first, last = solver.jump_operator.owned
    F = []
    for row in range(solver.jump_operator.global_rows):
        unit = (np.arange(first, last) == row).astype(float)
        F.append(np.concatenate(comm.allgather(solver.operator.apply(unit))))
    G, d = (np.concatenate(comm.allgather(x)) for x in (solver.natural.G.toarray(), solver.d))
    F, G, d = np.array(F)[np.ix_(active, active)], G[active], d[active]
    saddle = np.block([[F, -G], [-G.T, np.zeros((G.shape[1],) * 2)]])
    for strain in STRAINS:
        x = np.linalg.solve(saddle, np.r_[d @ strain, np.zeros(G.shape[1])])
        stress, state = response(cell, False, strain, status)
        lam = np.concatenate(comm.allgather(state.solution.lam))
        assert relative_error(lam[active], x[: len(F)]) < 1e-10
        assert (lam[~active] == 0).all()
        expected = (solver.torn_stiffness @ strain + d.T @ x[: len(F)]) / cell.summary.area
        assert relative_error(stress, expected) < 1e-10


@pytest.mark.quick
@pytest.mark.parametrize("bodies", ["torus", "plane"])
@pytest.mark.parametrize("subdomains", [1, 12])
def test_free_motions_of_debonded_fibres_are_counted(comm, bodies, subdomains):
    pieces = {"subdomains": subdomains}
    cell = torn_cells.tear(comm, geometry="hexagonal", mesh_size=0.2, bodies=bodies, decomposition=pieces)
    fibre = cell.solver.jump_operator.nodes.fibre
    both = np.full(len(fibre), OPEN, np.int8)
    lowest = comm.allreduce(fibre.min(initial=1000), min)
    one = np.where(fibre == lowest, OPEN, BONDED).astype(np.int8)
    pressed, pulled = [-1, -1, 0.1], [1, 1, 0.1]
    # Three motions each; pressed, the round fibres can only turn.
    for contact, status, strain, expected in (
        (False, both, pressed, 6), (False, one, pulled, 3), (True, both, pulled, 6), (True, both, pressed, 2),
        (True, one, pressed, 1),
    ):  # fmt: skip
        assert response(cell, contact, strain, status)[1].free_motions == expected


def test_a_fibre_that_turns_about_its_last_bond_has_one_place(comm):
    """Faces that touch without a force may hold it anywhere in its room, by the statuses from which they began."""
    cell = torn_cells.tear(comm, geometry="square", mesh_size=0.2)
    angle, start = directions(cell), np.zeros(cell.solver.rows)
    angles = np.concatenate(comm.allgather(angle))
    for last in np.sort(angles)[::3]:
        places = []
        for touching in (angle > 400, angle > 0, angle < 0):
            status = np.where(angle == last, BONDED, np.where(touching, CLOSED, OPEN)).astype(np.int8)
            load = Load.strain(np.array([1.0, 0.5, 0.3]))
            state = torn_cells.interface(cell, True).equilibrium(load, torn_cells.bonds(status), start)
            places.append(np.concatenate(comm.allgather(state.solution.jump)))
        assert np.abs(np.array(places) - places[0]).max() < 1e-9 * np.abs(places[0]).max()


def test_a_fibre_that_comes_free_opens_no_other_fibres_faces(comm):
    cell = torn_cells.tear(comm, geometry="hexagonal", mesh_size=0.2)
    fibre = cell.solver.jump_operator.nodes.fibre
    free = fibre == comm.allreduce(fibre.min(initial=1000), min)
    bonded = ~free & (np.abs(directions(cell)) < 90)
    status, start = np.where(bonded, BONDED, CLOSED).astype(np.int8), np.zeros(cell.solver.rows)
    # Without a strain no face carries a force.
    (state,) = torn_cells.interface(cell, True).equilibria(np.zeros((1, 3)), torn_cells.bonds(status), [start])
    assert state.free_motions == 3
    parallel_assert(comm, bool((state.status == np.where(free, OPEN, status)).all()))


def test_no_strain_is_no_stress(comm):
    cell = torn_cells.tear(comm, geometry="square", mesh_size=0.2)
    stress, state = response(cell, True, [0, 0, 0], np.full(len(directions(cell)), OPEN, np.int8))
    assert (stress == 0).all()
    assert max(state.certificate.values()) == 0


@pytest.mark.parametrize("half", [60, 170])
def test_single_pivots_find_the_same_state(comm, half):
    """Murty's rule alone, one node at a time, ends where the block pivots do."""
    cell = torn_cells.tear(comm, geometry="square", mesh_size=0.25)
    status = np.where(np.abs(directions(cell)) < half, OPEN, BONDED).astype(np.int8)
    strain = [0.3, -0.6, 0.5]
    expected, block = response(cell, True, strain, status)
    interface = replace(torn_cells.interface(cell, True), block_pivots=0)
    single = interface.equilibrium(Load.strain(np.array(strain)), torn_cells.bonds(status), np.zeros(cell.solver.rows))
    stress = torn_cells.stress(cell, single.solution)
    assert 1 < single.solves < 10 * MOST_SOLVES
    assert comm.allreduce(int((single.status != block.status).sum())) == 0
    assert relative_error(stress, expected) < 1e-9


def test_forces_between_pieces_of_a_stiff_matrix_hide_no_tension(comm):
    """Forces between pieces are 10 000 times those on a soft fibre; contact does not depend on them."""
    arc, fibre = Arc(fibre="all", centre=20.0, angle=140.0), {"young": 88e-4, "poisson": 0.222}
    cell = {"fibre": fibre, "mesh_size": 0.1, "refine": 2, "petsc": {"feti_ksp_rtol": 1e-8}}
    found = []
    for pieces in ({"subdomains": 40}, {}):
        torn = torn_cells.tear(comm, [arc], decomposition=pieces, **cell)
        stress, state = response(torn, True, [0, -1, 0], np.where(torn.debonded(None), OPEN, BONDED).astype(np.int8))
        forces = state.solution.lam[torn.solver.jump_operator.nodes.row]
        largest = [comm.allreduce(np.abs(all_of).max(initial=0.0), MPI.MAX) for all_of in (state.solution.lam, forces)]
        parallel_assert(comm, max(state.certificate.values()) < 1e-7, f"{state.certificate}")
        found.append((stress, comm.allreduce(int((state.status == CLOSED).sum())), largest[0] / largest[1]))
    (cut, closed, ratio), (whole, expected, _) = found
    parallel_assert(comm, ratio > 1000 and closed == expected > 0, f"{ratio}, {closed} closed, expected {expected}")
    assert relative_error(cut, whole) < 1e-6
