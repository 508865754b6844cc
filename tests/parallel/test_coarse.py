"""The adaptive coarse space against dense algebra."""

import numpy as np
import pytest
from mpi4py import MPI
from reference import dense_feti
from scipy.linalg import eigh
from support import torn_cells
from support.cases import FIBRE, MATRIX, case_of, relative_error, solve
from support.coarse_space_cells import BOUND, BREAKING, NARROW, SINGLE, agree, masks, of_all, solve_many

from feti_homog.feti.coarse.geneo import kernels_and_soft_modes, subdomain_blocks
from feti_homog.feti.decomposition.interface_neighbours import Neighbours
from feti_homog.feti.operators.interface_operators import InterfaceOperators
from feti_homog.feti.operators.preconditioners import Dirichlet
from feti_homog.feti.thresholds import DEFAULTS, Thresholds
from feti_homog.interface.contact.states import BONDED, OPEN

pytestmark = pytest.mark.parallel

THRESHOLD = DEFAULTS.soft_mode


# The soft modes.


def test_soft_modes_are_counted_as_dense_eigenvalues(comm, narrow):
    expected = [
        int((theta < THRESHOLD).sum()) - R.shape[1]
        for (theta, _), R in zip(narrow.soft_modes(), narrow.dense.kernels, strict=True)
    ]
    assert of_all(comm, narrow.coarse, narrow.cell) == expected
    assert max(expected) > 2
    assert min(expected) == 0
    assert narrow.solver.coarse_dimension == sum(expected) + narrow.dense.G.shape[1]


def test_soft_modes_solve_the_eigenproblem(comm, narrow):
    """S p = theta N p for the modes made N-orthogonal to the kernel; N from all ranks' data."""
    jump_operator, subdomains = narrow.solver.jump_operator, narrow.cell.subdomains
    boundary = InterfaceOperators(jump_operator, subdomains, "explicit", 1, True)
    neighbours = Neighbours(comm, jump_operator, subdomains)
    scaled = Dirichlet(boundary)
    blocks = subdomain_blocks(boundary, scaled, neighbours.rows)
    found = kernels_and_soft_modes(blocks, neighbours, THRESHOLD)
    for s, V, count in zip(subdomains, found, narrow.coarse.counts, strict=True):
        B, S = narrow.dense.B[s.submesh.index], narrow.dense.S[s.submesh.index]
        N, k = B.T @ narrow.M @ B, s.R.shape[1]
        R, p = V[:, :k], V[:, k:]
        assert p.shape == (len(S), count)
        assert np.abs(S @ R).max() < 1e-10 * np.abs(S).max()
        p = p - R @ np.linalg.solve(R.T @ N @ R, R.T @ N @ p)
        p = p / np.sqrt(np.einsum("ik,ij,jk->k", p, S, p))
        theta = 1.0 / np.einsum("ik,ij,jk->k", p, N, p)
        p = p / theta  # as a step of inverse iteration makes them from modes of energy 1
        assert (theta < THRESHOLD).all() and (theta > 1e-8).all()
        residual = S @ p - (N @ p) * theta
        # Entries of N are rounded, and cancel each other in N p.
        assert np.abs(residual).max(initial=0.0) <= SINGLE * (np.abs(N) @ np.abs(p) * theta).max(initial=0.0)


# The balanced preconditioner.


def dense_modes(dense, M):
    """Return the kernel and the soft modes of each subdomain, from dense eigenproblems."""
    pairs = (eigh(S, B.T @ M @ B) for B, S in zip(dense.B, dense.S, strict=True))
    return [modes[:, theta < THRESHOLD] for theta, modes in pairs]


def test_the_preconditioner_is_that_of_dense_modes(narrow):
    expected = narrow.dense.balanced(narrow.all, dense_modes(narrow.dense, narrow.M))
    assert relative_error(narrow.H, expected) < 10 * SINGLE


def test_rigid_motions_need_no_force(narrow):
    """G^T H = 0 and H G = 0; H is symmetric and positive semidefinite."""
    largest = np.abs(narrow.H).max()
    for product in (narrow.dense.G.T @ narrow.H, narrow.H @ narrow.dense.G):
        assert np.abs(product).max() < 1e-9 * largest
    assert np.abs(narrow.H - narrow.H.T).max() < 1e-10 * largest
    assert np.linalg.eigvalsh(narrow.H)[0] > -1e-10 * np.linalg.norm(narrow.H, 2)


def test_balanced_forces_are_not_balanced_any_further(comm, narrow):
    """S_0 S+ S_0 = S_0: coarse displacements have found their equilibrium."""
    operators, coarse = narrow.solver.interface_operators, narrow.coarse
    x = np.random.default_rng(comm.rank).standard_normal((operators.offsets[-1], 2))
    forces = coarse.balanced(x)
    again = coarse.balanced(operators.apply_flexibility(forces))
    size = comm.allreduce(np.abs(forces).max(initial=0.0), MPI.MAX)
    assert np.abs(again - forces).max(initial=0.0) < 1e-9 * size


# The spectrum.


def test_balancing_bounds_the_spectrum(narrow):
    least, largest = dense_feti.extreme_eigenvalues(narrow.dense.F, narrow.H)
    P = dense_feti.projector(narrow.dense.G)
    natural = dense_feti.extreme_eigenvalues(narrow.dense.F, P @ narrow.M @ P)[1]
    assert least > 1 - 1e-8
    assert largest < BOUND / THRESHOLD
    assert natural > 20 * largest


def test_a_higher_threshold_takes_more_vectors(comm, narrow):
    solver = torn_cells.tear(comm, **NARROW, petsc={"feti_coarse_threshold": 0.5}).solver
    assert solver.adaptive.threshold == 0.5 and solver.coarse_dimension > narrow.solver.coarse_dimension


def test_all_modes_make_the_exact_inverse(comm):
    """Then Z spans all displacements of the glued cell, most of them twice, and there is nothing to iterate."""
    cell = torn_cells.tear(comm, **BREAKING, thresholds=Thresholds(soft_mode=1e12))
    dense = dense_feti.DenseDual(cell)
    H, P = dense_feti.matrix(cell, cell.solver.preconditioner.apply), dense_feti.projector(dense.G)
    assert np.abs(H @ dense.F @ P - P).max() < 1e-5
    assert max(solution.iterations for solution in solve_many(cell)) <= 3


@pytest.mark.parametrize("unit", [1e-30, 1e30])
def test_modes_are_the_same_in_any_unit_of_stress(comm, narrow, unit):
    """No rigid motion is taken for rounding beside soft modes, and none of these beside rigid motions."""
    matrix, fibre = ({**phase, "young": unit * phase["young"]} for phase in (MATRIX, FIBRE))
    cell = torn_cells.tear(comm, **NARROW, matrix=matrix, fibre=fibre)
    assert of_all(comm, cell.solver.adaptive, cell) == of_all(comm, narrow.coarse, narrow.cell)
    found, expected = (solve_many(c)[0].iterations for c in (cell, narrow.cell))
    assert found == expected


def test_a_coarse_space_without_vectors(comm):
    """Two pieces of a matrix around a void that both hold the pinned class: none can move, and none is soft."""
    found = []
    for space in ("adaptive", "natural"):
        void = {"x": 0.0, "y": 0.0, "radius": 0.15, "phase": "void"}
        table = {"geometry": "table", "width": 1.0, "height": 1.0, "mesh_size": 0.1, "fibre_list": [void]}
        petsc = {"feti_coarse_space": space, "feti_ksp_rtol": 1e-10}
        case = case_of(table, material={"matrix": MATRIX}, decomposition={"subdomains": 2}, petsc=petsc)
        cell, L, _ = solve(case, comm)
        found.append(L)
        if comm.size <= 2:
            assert cell.solver.coarse_dimension == 0
    assert relative_error(*found) < 1e-9


# Inactive rows.


def test_updated_coarse_matrix_equals_one_from_scratch(comm):
    cell, fresh = torn_cells.tear(comm, **BREAKING), torn_cells.tear(comm, **BREAKING)
    steps = masks(cell, range(3))
    for active in steps:
        cell.solver.set_state(active, cell.solver.intact_compliance)
    fresh.solver.set_state(steps[-1], fresh.solver.intact_compliance)
    found, scratch = (c.solver.adaptive.part().toarray() for c in (cell, fresh))
    # A rank may have no subdomain.
    assert not found.size or relative_error(found, scratch) < 1e-12
    first, second = (dense_feti.matrix(c, c.solver.preconditioner.apply) for c in (cell, fresh))
    assert relative_error(first, second) < 1e-8
    assert cell.solver.adaptive.factorizations == len(steps) + 1


def test_the_preconditioner_of_active_rows_is_that_of_dense_modes(comm):
    cell = torn_cells.tear(comm, **BREAKING)
    dense = dense_feti.DenseDual(cell)
    V = dense_modes(dense, dense.preconditioner(np.ones(dense.total, bool)))
    for active in masks(cell, range(2)):
        cell.solver.set_state(active, cell.solver.intact_compliance)
        on = dense_feti.gathered(cell, active) > 0
        assert 0.05 < (~on).mean() < 0.5
        H = dense_feti.matrix(cell, lambda z, a=active: cell.solver.preconditioner.apply(a[:, None] * z))
        assert (H[~on] == 0).all() and (H[:, ~on] == 0).all()
        assert relative_error(H, dense.balanced(on, V)) < 10 * SINGLE
        G = np.where(on[:, None], dense.G, 0.0)
        assert np.abs(H @ G).max() < 1e-9 * np.abs(H).max()
        least, _ = dense_feti.extreme_eigenvalues(dense.F[np.ix_(on, on)], H[np.ix_(on, on)])
        assert least > 1 - 1e-8


@pytest.mark.parametrize(
    ("case", "share"),
    [(BREAKING, 0.9), (NARROW | {"refine": 1}, 0.4)],
    ids=["breaking", "narrow"],
)
def test_with_inactive_rows_the_solution_is_that_of_the_natural_space(comm, case, share):
    """In that share of the iterations."""
    adaptive, natural = (
        torn_cells.tear(comm, **case, petsc={"feti_coarse_space": space}) for space in ("adaptive", "natural")
    )
    assert adaptive.solver.adaptive is not None and natural.solver.adaptive is None
    first = solve_many(adaptive)
    steps = masks(adaptive, range(3))
    for active in [*steps, np.ones(len(steps[0]))]:
        for cell in (adaptive, natural):
            cell.solver.set_state(active, cell.solver.intact_compliance)
        found, expected = (solve_many(c) for c in (adaptive, natural))
        agree(adaptive, found, expected)
        assert found[0].iterations <= share * expected[0].iterations
    agree(adaptive, found, first)


@pytest.mark.parametrize(("case", "which"), [(BREAKING, "all"), (NARROW, "one")], ids=["breaking", "narrow"])
def test_fibres_that_float_keep_the_natural_spaces_solution(comm, case, which):
    """Without contact, fibres whose interface is wholly open."""
    results = []
    for space in ("adaptive", "natural"):
        cell = torn_cells.tear(comm, **case, petsc={"feti_coarse_space": space})
        fibre = cell.solver.jump_operator.nodes.fibre
        lowest = comm.allreduce(fibre.min(initial=1000), MPI.MIN)
        status = np.where((fibre == lowest) | (which == "all"), OPEN, BONDED).astype(np.int8)
        cell.solver.set_state(torn_cells.interface(cell, False).active(status), cell.solver.intact_compliance)
        fibres = len(set().union(*comm.allgather(set(fibre)))) if which == "all" else 1
        assert cell.solver.natural.unconstrained_modes.shape[1] == 3 * fibres
        results.append(solve_many(cell))
    for found, expected in zip(*results, strict=True):
        assert found.reason > 0
        assert relative_error(*(torn_cells.stress(cell, solution) for solution in (found, expected))) < 1e-8
