"""The inverse of the dual operator by influence columns, against dense algebra and the other preconditioners."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from mpi4py import MPI
from reference.dense_feti import DenseDual, gathered, matrix
from scipy.linalg import null_space
from support import torn_cells
from support.coarse_space_cells import BREAKING, NARROW, solve_many

from feti_homog.errors import CaseError, ConvergenceError
from feti_homog.feti.operators.one_subdomain import ExplicitInterfaceOperator
from feti_homog.feti.thresholds import DEFAULTS, Thresholds
from feti_homog.interface.contact.states import BONDED, CLOSED, OPEN

pytestmark = pytest.mark.parallel

INFLUENCE = {"feti_pc_type": "influence"}
# A stiffness is expected to apply the dual operator more often than this.
WORTH_WHILE = Thresholds(influence_applications=60)
CELLS = pytest.mark.parametrize(
    "case",
    [
        {"geometry": "square"},
        {"geometry": "hexagonal", "bodies": "plane", "order": 2},
        {"geometry": "random", "fibres": 3, "fibre_fraction": 0.3, "min_gap": 0.1},
        BREAKING,
    ],
    ids=["square", "plane bodies", "random", "cut"],
)


def inverse(dense, active, compliance=0.0):
    """(total, total) N (N^T (F + C) N)^-1 N^T for a basis N of forces on the active rows that are in equilibrium."""
    N = np.eye(dense.total)[:, active]
    N = N @ null_space(dense.G.T @ N)
    return N @ np.linalg.solve(N.T @ (dense.F + np.diag(compliance + np.zeros(dense.total))) @ N, N.T)


def activate(cell, status):
    """Return the active rows, on all ranks, of a status; the solver is set to them."""
    active = torn_cells.interface(cell, True).active(status)
    cell.solver.set_state(active, cell.solver.intact_compliance)
    return gathered(cell, active) > 0


def states(cell):
    """Statuses that open, close, bond again and loosen a whole fibre, which is pressed here and there and let go."""
    nodes = cell.solver.jump_operator.nodes
    angle = np.degrees(np.arctan2(nodes.normal[:, 1], nodes.normal[:, 0]))
    bonded = np.full(len(nodes.row), BONDED, np.int8)
    arc = np.where(np.abs(angle) < 40, OPEN, bonded)
    closed = np.where(np.abs(angle) < 15, CLOSED, arc)
    longer = np.where(np.abs(angle) < 70, OPEN, bonded)
    first = nodes.fibre == cell.comm.allreduce(nodes.fibre.min(initial=10**9), MPI.MIN)
    loose = np.where(first, OPEN, longer)
    pressed = [
        np.where(first & np.any([np.abs(angle - a) < 25 for a in at], axis=0), CLOSED, loose)
        for at in ((-120, 0, 120), (0,), (-120, 0, 120), (90,), (-60, 60))
    ]
    assert cell.comm.allreduce(bool((loose != longer).any()), MPI.LOR)
    return [bonded, arc, closed, longer, loose, *pressed, loose, arc, bonded]


@CELLS
@pytest.mark.parametrize("columns", [700, 20], ids=["one reference cell", "some"])
def test_influence_columns_give_the_inverse_for_any_active_rows(comm, case, columns):
    cell = torn_cells.tear(comm, **case, petsc=INFLUENCE | {"feti_influence_columns": columns})
    dense, influence = DenseDual(cell), cell.solver.exact_inverse
    assert influence is not None
    size, masks = np.linalg.norm(inverse(dense, slice(None)), 2), [np.ones(dense.total, bool)]
    assert size <= influence.norm < 20 * size
    for status in states(cell):
        active = activate(cell, status)
        masks.append(active)
        expected = inverse(dense, active)
        found = matrix(cell, influence.apply)
        # A single fibre that is loose leaves nothing of it.
        tolerance = 1e-8 * size
        assert np.abs(found - expected).max() < tolerance
        assert np.abs(found[~active]).max(initial=0.0) == 0.0
        alone = gathered(cell, influence.apply(np.ones(cell.solver.rows)))
        assert np.abs(alone - expected @ np.ones(dense.total)).max() < 10 * tolerance
        d, E = cell.solver.d, np.array([[1.0, 0.2], [-0.5, 0.0], [0.3, 1.0]])
        assert np.abs(gathered(cell, influence.multipliers(d, E)) - expected @ gathered(cell, d) @ E).max() < tolerance
        rows = influence.neighbours.rows
        bonded = rows[active[rows] & active[rows + 1]]
        blocks = influence.inverse_blocks(bonded[:, None] + np.arange(2))
        for row, block in zip(bonded, blocks, strict=True):
            assert np.abs(block - expected[row : row + 2, row : row + 2]).max() < tolerance
        assert np.linalg.eigvalsh(expected).max() <= influence.norm
    # The first reference cell, and with one column another for each change that takes more.
    changes = sum(bool((a != b).any()) for a, b in pairwise(masks))
    least, most = {700: (1, 1), 20: (2, changes - 1), 1: (changes, changes + 1)}[columns]
    assert least <= influence.factorizations <= most


@pytest.mark.parametrize("columns", [700, 1], ids=["one reference cell", "one a state"])
def test_springs_that_softened_while_their_rows_were_not_active_are_soft_when_they_come(comm, columns):
    petsc = INFLUENCE | {"feti_influence_columns": columns}
    cell = torn_cells.tear(comm, geometry="square", springs=(30.0, 12.0), petsc=petsc)
    dense, solver, influence = DenseDual(cell), cell.solver, cell.solver.exact_inverse
    C, d, size = solver.intact_compliance, solver.d, np.linalg.norm(inverse(dense, slice(None)), 2)
    for number, status in enumerate(states(cell)[:4] * 2):
        active = torn_cells.interface(cell, True).active(status)
        compliance = C * (1.0 + number * (1.0 + np.cos(np.arange(len(C)))))
        solver.set_state(active, compliance)
        expected = inverse(dense, gathered(cell, active) > 0, gathered(cell, compliance))
        assert np.abs(matrix(cell, influence.apply) - expected).max() < 1e-9 * size
        assert np.abs(gathered(cell, influence.multipliers(d, np.eye(3))) - expected @ gathered(cell, d)).max() < 1e-9


@pytest.mark.parametrize("columns", [700, 20, 4], ids=["one reference cell", "some", "many"])
def test_blocks_are_right_with_few_followed_columns(comm, columns):
    """Bonds break one after another all around a fibre; others' columns go when there is no room for more."""
    cell = torn_cells.tear(comm, geometry="square", petsc=INFLUENCE | {"feti_influence_columns": columns})
    dense, influence, d = DenseDual(cell), cell.solver.exact_inverse, cell.solver.d
    size, influence.most_followed, influence.batch = np.linalg.norm(inverse(dense, slice(None)), 2), 14, 6
    influence._restart()
    status = np.full(len(cell.solver.jump_operator.nodes.row), BONDED, np.int8)
    rows, first, kept = influence.neighbours.rows, influence.neighbours.first, []
    for number in range(len(rows) - 3):
        own = number - first
        if 0 <= own < len(status):
            status[own] = OPEN
        active = activate(cell, status)
        # The next ones, and far ones that come and go.
        wanted = np.unique([number + 1, number + 2, len(rows) - 1 - number % 3, (5 * number) % len(rows)])
        wanted = wanted[active[rows[wanted]]]
        expected = inverse(dense, active)
        found, _ = influence.answer(d, np.eye(3))
        assert np.abs(gathered(cell, found) - expected @ gathered(cell, d)).max() < 1e-8 * size
        # A confirmation makes the answer anew, whatever it was.
        influence._followed.answer = 2.0 * influence._followed.answer
        influence.multipliers(d, np.eye(3))
        assert np.abs(influence.answer(d, np.eye(3))[0] - found).max(initial=0.0) < 1e-8 * size
        for row, block in zip(rows[wanted], influence.inverse_blocks(rows[wanted, None] + np.arange(2)), strict=True):
            assert np.abs(block - expected[row : row + 2, row : row + 2]).max() < 1e-8 * size
        kept.append(influence._followed)
    assert len(kept) > 12 and all(each is kept[0] for each in kept)


@pytest.mark.parametrize("on_active", [True, False], ids=["multipliers", "jumps"])
def test_f_lambda_finds_errors_of_a_followed_answer(comm, on_active):
    cell = torn_cells.tear(comm, geometry="square", petsc=INFLUENCE)
    solver, influence, E = cell.solver, cell.solver.exact_inverse, np.array([1.0, 0.2, -0.3])
    activate(cell, states(cell)[1])
    whole = influence.multipliers(solver.d, np.eye(3)) * solver.jumps.active[:, None]
    for size, ends in ((1e-9, False), (1e-2, on_active)):
        # F lambda confirms, is spared, confirms again.
        for _ in range(2):
            solver.solve(E, np.zeros(solver.rows))
        right = influence._followed.answer
        wrong = (solver.jumps.active == on_active)[:, None] * size * right
        influence._followed.answer = right + wrong
        if ends:
            with pytest.raises(ConvergenceError, match="relative error"):
                solver.solve(E, np.zeros(solver.rows))
            continue
        solver.solve(E, np.zeros(solver.rows))
        error = np.abs(influence._followed.answer - right).max(initial=0.0)
        largest = comm.allreduce(float(np.abs(whole).max(initial=0.0)), MPI.MAX)
        assert comm.allreduce(float(error), MPI.MAX) < 1e-12 * largest
        solver._by_columns.record([], solver.d)


@pytest.mark.few_ranks  # four would cut the matrix, whose pieces bear more forces: rounding is 3e-13 then
def test_rounding_of_answers_is_estimated_while_few_faces_hold_a_free_fibre(comm):
    """Faces beside each other hold it loosely, faces around it well; an answer that rounds too much is renewed."""
    cell = torn_cells.tear(comm, geometry="square", mesh_size=0.2, order=2, petsc=INFLUENCE)
    solver, influence, dense = cell.solver, cell.solver.exact_inverse, DenseDual(cell)
    angle = np.degrees(np.arctan2(*solver.jump_operator.nodes.normal.T[::-1]))
    d, estimates = gathered(cell, solver.d), []
    for turn, middle in enumerate(range(-120, 120, 20)):
        for at in ([], [middle - 12, middle, middle + 12], [middle, middle - 120, middle + 120]):
            away = np.abs((angle[:, None] - np.array(at) + 180) % 360 - 180)
            active = activate(cell, np.where((away < 6).any(axis=1), CLOSED, OPEN).astype(np.int8))
            influence._followed.rounding += float(turn == 9)
            answer = influence.answer(solver.d, np.eye(3), solver.natural.unconstrained_modes.shape[1])
            if active.any() and answer is not None:
                jump, G = (d - dense.F @ gathered(cell, answer[0]))[active], dense.G[active]
                estimates.append(influence._followed.rounding)
                error = np.abs(jump - G @ np.linalg.lstsq(G, jump, 1e-10)[0]).max()
                assert error < (3.0 * estimates[-1] + 1e-14) * np.abs(d).max()
    assert min(estimates[1:]) == 0.0 < max(estimates) < 1e-12


@pytest.mark.few_ranks  # four would cut the matrix, whose pieces bear more forces
@pytest.mark.parametrize("share", [1e-8, 1e-12])
def test_multipliers_that_cancel_are_measured_by_those_of_single_strains(comm, share):
    """Two bonds hold the fibre: no more than one force in equilibrium, which some loads take to zero."""
    cell = torn_cells.tear(comm, geometry="square", petsc=INFLUENCE)
    solver, influence, nodes = cell.solver, cell.solver.exact_inverse, cell.solver.jump_operator.nodes
    number = influence.neighbours.first + np.arange(len(nodes.row))
    status = np.where(np.isin(number, [0, len(influence.neighbours.rows) // 2]), BONDED, OPEN).astype(np.int8)
    for _ in range(2):
        solver.solve(np.array([1.0, 0.2, -0.3]), np.zeros(solver.rows))
    activate(cell, status)
    U = gathered(cell, influence.multipliers(solver.d, np.eye(3)))
    assert np.linalg.matrix_rank(U, 1e-9 * np.abs(U).max()) == 1
    right = influence._followed.answer
    influence._followed.answer = right * np.array([1.0, 1.0 + 1e-11, 1.0])
    _, _, unseen = np.linalg.svd(U)
    solution = solver.solve(unseen[1] + unseen[2] + share * unseen[0], np.zeros(solver.rows))
    assert solver._by_columns._prediction is not None and solution.reason > 0 and gathered(cell, solution.lam).any()
    assert np.abs(influence._followed.answer - right).max(initial=0.0) < 1e-14 * np.abs(gathered(cell, right)).max()


@pytest.mark.parametrize("unit", [1.0, 1e20, 1e-20])
def test_new_columns_show_what_is_wrong_in_those_that_are_followed(comm, unit):
    """Columns of rows that left are off by a little: they are not symmetric with new ones, and nothing is followed."""
    fibre, matrix = ({"young": young * unit, "poisson": 0.3} for young in (3.0, 1.0))
    cell = torn_cells.tear(comm, geometry="square", fibre=fibre, matrix=matrix, petsc=INFLUENCE)
    influence, d, expected = cell.solver.exact_inverse, cell.solver.d, np.zeros(0)
    rows, first, influence.batch = influence.neighbours.rows, influence.neighbours.first, 1
    size = np.linalg.norm(inverse(DenseDual(cell), slice(None)), 2)
    for wrong in (False, True):
        influence.multipliers(d, np.eye(3))
        for number in (2 * wrong + 1, 2 * wrong + 2):
            status = np.where(first + np.arange(len(cell.solver.jump_operator.nodes.row)) < number, OPEN, BONDED)
            expected = inverse(DenseDual(cell), activate(cell, status.astype(np.int8)))
        followed = influence._followed
        if wrong:
            followed._buffer[:, followed._slot[rows[0]]] *= 1.0 + 1e-4
        (block,) = influence.inverse_blocks(rows[[-1 - wrong], None] + np.arange(2))
        at = slice(rows[-1 - wrong], rows[-1 - wrong] + 2)
        assert np.abs(block - expected[at, at]).max() < 1e-8 * size
        assert (influence._followed is followed) != wrong


def test_influence_columns_stay_exact_at_narrow_gaps_and_contrasts(comm):
    for contrast in (1e-6, 1e6):
        cell = torn_cells.tear(comm, **NARROW, fibre={"young": 3.0 * contrast, "poisson": 0.3}, petsc=INFLUENCE)
        solutions = solve_many(cell)
        assert all(s.reason > 0 and s.iterations <= 3 and s.residual < 1e-7 for s in solutions)


@pytest.mark.parametrize(
    ("thresholds", "petsc", "chosen"),
    [
        (WORTH_WHILE, {}, True),
        (DEFAULTS, {}, False),
        (WORTH_WHILE, {"feti_pc_type": "dirichlet"}, False),
        (WORTH_WHILE, {"feti_coarse_space": "adaptive"}, False),
        (WORTH_WHILE, {"feti_dual_operator": "implicit"}, False),
    ],
    ids=["many applications", "few applications", "dirichlet", "adaptive", "implicit"],
)
def test_influence_columns_are_chosen_for_many_applications(comm, thresholds, petsc, chosen):
    solver = torn_cells.tear(comm, thresholds=thresholds, **BREAKING, petsc=petsc).solver
    assert (solver.exact_inverse is not None) == chosen
    if chosen:
        assert all(isinstance(o, ExplicitInterfaceOperator) for o in solver.interface_operators.operators)


def test_influence_columns_are_not_chosen_where_the_bonded_cell_is_too_large(comm):
    cell = torn_cells.tear(comm, thresholds=replace(WORTH_WHILE, assembled_schur_dofs=10), **BREAKING)
    assert cell.solver.exact_inverse is None


def test_more_ranks_than_subdomains(comm):
    cell = torn_cells.tear(comm, geometry="square", decomposition={"subdomains": 2}, petsc=INFLUENCE)
    for status in states(cell):
        activate(cell, status)
        assert all(s.reason > 0 and s.iterations == 0 and s.residual < 1e-8 for s in solve_many(cell))


def test_influence_columns_that_cannot_be_are_refused(comm):
    with pytest.raises(CaseError, match="-feti_influence_columns 0: expected an integer of at least 1"):
        torn_cells.tear(comm, **BREAKING, petsc=INFLUENCE | {"feti_influence_columns": 0})
    with pytest.raises(CaseError, match="-feti_pc_type influence: needs -feti_dual_operator explicit"):
        torn_cells.tear(comm, **BREAKING, petsc=INFLUENCE | {"feti_dual_operator": "implicit"})


def test_view_shows_the_influence_columns(comm, capfd):
    cell, text = torn_cells.printed(comm, capfd, **BREAKING, petsc=INFLUENCE | {"feti_view": True})
    size = 2 * comm.allreduce(len(cell.solver.jump_operator.node_rows[0]))
    assert f"influence columns by the bonded cell, {size} dofs on its shared nodes" in text
    assert "1 load case, 0 iterations" in text
