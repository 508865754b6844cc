"""The adaptive coarse space against dense algebra."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI
from reference import dense_feti
from support import torn_cells
from support.cases import relative_error
from support.coarse_space_cells import BOUND, BREAKING, NARROW, SINGLE, Narrow, agree, masks, of_all, solve_many

from feti_homog.feti.coarse.adaptive import AdaptiveCoarseSpace, Deflation
from feti_homog.feti.coarse.geneo import kernels_and_soft_modes, subdomain_blocks
from feti_homog.feti.decomposition.neighbours import Neighbours
from feti_homog.feti.linalg.collectives import allreduce_sparse
from feti_homog.feti.operators.interface_operators import InterfaceOperators
from feti_homog.feti.preconditioners.scaled import Dirichlet
from feti_homog.feti.thresholds import DEFAULTS, Thresholds
from feti_homog.interface.contact import BONDED, OPEN

pytestmark = pytest.mark.parallel

THRESHOLD = DEFAULTS.soft_mode


# The coarse vectors.


def test_soft_modes_are_counted_as_dense_eigenvalues(comm, narrow):
    expected = [
        int((theta < THRESHOLD).sum()) - R.shape[1]
        for (theta, _), R in zip(narrow.soft_modes(), narrow.dense.kernels, strict=True)
    ]
    assert of_all(comm, narrow.coarse, narrow.cell) == expected
    assert max(expected) > 2
    assert min(expected) == 0
    assert narrow.coarse.coarse_dimension == sum(expected) + narrow.dense.G.shape[1]


def test_soft_modes_solve_the_eigenproblem(comm, narrow):
    """S p = theta N p for the modes made N-orthogonal to the kernel; N from all ranks' data."""
    jump_operator, subdomains = narrow.solver.jump_operator, narrow.cell.subdomains
    boundary = InterfaceOperators(jump_operator, subdomains, "explicit", 1, True)
    neighbours = Neighbours(comm, jump_operator, subdomains)
    scaled = Dirichlet(comm, jump_operator, boundary)
    blocks = subdomain_blocks(comm, jump_operator, boundary, scaled, neighbours.rows)
    found = kernels_and_soft_modes(blocks, neighbours, THRESHOLD)
    for s, V, count in zip(subdomains, found, narrow.coarse.counts, strict=True):
        B, S = narrow.dense.B[s.submesh.index], narrow.dense.S[s.submesh.index]
        N, k = B.T @ narrow.M @ B, s.R.shape[1]
        R, p = V[:, :k], V[:, k:]
        assert p.shape == (len(S), count)
        assert np.abs(S @ R).max() < 1e-10 * np.abs(S).max()
        p = p - R @ np.linalg.solve(R.T @ N @ R, R.T @ N @ p)
        theta = np.einsum("ik,ij,jk->k", p, S, p) / np.einsum("ik,ij,jk->k", p, N, p)
        assert (theta < THRESHOLD).all() and (theta > 1e-8).all()
        residual = S @ p - (N @ p) * theta
        assert np.abs(residual).max(initial=0.0) < SINGLE * np.abs(S @ p).max(initial=1.0)


def test_coarse_vectors_are_preconditioned_jumps(comm, narrow):
    """U = M^-1 B V of the kernels and the modes, the same space from dense ones."""
    jumps = [
        B @ modes[:, theta < THRESHOLD] for B, (theta, modes) in zip(narrow.dense.B, narrow.soft_modes(), strict=True)
    ]
    expected = narrow.M @ np.hstack(jumps)
    assert expected.shape == narrow.U.shape
    assert dense_feti.distance(narrow.U, expected) < SINGLE
    assert dense_feti.distance(expected, narrow.U) < SINGLE


# The coarse problem.


def test_deflation_leaves_what_no_coarse_vector_can_improve(narrow):
    """T z is what no coarse vector can improve; dense, with another generalized inverse."""
    T = dense_feti.matrix(narrow.cell, narrow.coarse.deflate)
    assert relative_error(T, narrow.T) < 1e-9
    assert np.abs(T @ T - T).max() < 1e-9 * np.abs(T).max()
    assert np.abs(narrow.dense.G.T @ T).max() < 1e-9 * np.abs(T).max()
    V = narrow.U @ null_space(narrow.dense.G.T @ narrow.U)
    V /= np.linalg.norm(V, axis=0)
    assert V.shape[1] > 10
    F = dense_feti.matrix(narrow.cell, narrow.solver.operator.apply)
    assert np.abs(V.T @ F @ T).max() < 1e-9 * np.abs(V.T @ F).max()


def test_many_columns_are_deflated_as_each_alone(narrow):
    x = narrow.own(narrow.random(0, (3,)))
    for function in (narrow.coarse.deflate, narrow.coarse.project_residual):
        columns = function(x)
        for k in range(3):
            alone = function(x[:, k].copy())
            assert np.abs(alone - columns[:, k]).max(initial=0.0) < 1e-10 * np.abs(columns).max(initial=1.0)


def test_the_iteration_applies_the_projected_operator(narrow):
    """What is left of residual(F T z) after T M^-1 is that of T^T F T z."""
    coarse, F, M = narrow.coarse, narrow.solver.operator, narrow.solver.preconditioner
    found = dense_feti.matrix(
        narrow.cell, lambda z: coarse.deflate(M.apply(coarse.project_residual(F.apply(coarse.deflate(z)))))
    )
    assert relative_error(found, narrow.T @ narrow.M @ narrow.T.T @ narrow.dense.F @ narrow.T) < 1e-9


def _improved(narrow, r):
    """This rank's rows of the coarse correction of nothing, and the residual that it leaves of r."""
    lam, residual = narrow.coarse.coarse_initial_guess(
        np.zeros((narrow.solver.rows, 1)), narrow.own(r)[:, None], narrow.solver.operator.apply
    )
    return lam[:, 0], residual[:, 0]


def test_after_a_correction_coarse_vectors_see_rigid_motions_only(narrow):
    """After a correction coarse vectors see rigid-body motions only; what is taken off is of rigid-body motions too."""
    coarse, F = narrow.coarse, dense_feti.matrix(narrow.cell, narrow.solver.operator.apply)
    r = narrow.random(1)
    c, left = (dense_feti.gathered(narrow.cell, x) for x in _improved(narrow, r))
    lengths = np.linalg.norm(narrow.U, axis=0)
    seen, motions = (narrow.U.T @ x / lengths[:, None] for x in (left[:, None], narrow.dense.G))
    beside = seen - motions @ np.linalg.lstsq(motions, seen, rcond=None)[0]
    assert np.abs(beside).max() < 1e-9 * np.abs(narrow.U.T @ r / lengths).max()
    taken = r - F @ c - left
    P = dense_feti.projector(narrow.dense.G)
    assert np.linalg.norm(P @ taken) < 1e-9 * np.linalg.norm(taken)
    again = dense_feti.gathered(narrow.cell, coarse.project_residual(narrow.own(left)))
    assert np.linalg.norm(again - left) < 1e-9 * np.linalg.norm(left)


def test_the_initial_correction_has_the_least_energy(narrow):
    """z^T F z / 2 - z^T r is least of all z = U c with G^T z = 0."""
    F, r = narrow.dense.F, narrow.random(2)
    V = narrow.U @ null_space(narrow.dense.G.T @ narrow.U)
    V /= np.linalg.norm(V, axis=0)
    expected = V @ np.linalg.lstsq(V.T @ F @ V, V.T @ r, rcond=1e-13)[0]
    found = dense_feti.gathered(narrow.cell, _improved(narrow, r)[0])
    assert relative_error(found, expected) < 1e-8
    assert np.abs(narrow.dense.G.T @ found).max() < 1e-9 * np.abs(found).max()

    def energy(z):
        return z @ F @ z / 2 - z @ r

    steps = V @ np.random.default_rng(3).standard_normal((V.shape[1], 20))
    assert energy(found) < 0
    assert all(energy(found) < energy(found + t * step) for step in steps.T for t in (-1e-3, 1e-3))


def null_space(A):
    """Orthonormal null space of a wide matrix, its columns scaled."""
    scale = 1 / np.linalg.norm(A, axis=0)
    values, rows = np.linalg.svd(A * scale)[1:]
    return scale[:, None] * rows[(values > 1e-11 * values[0]).sum() :].T


# The spectrum.


def test_deflation_bounds_the_spectrum(narrow):
    least, largest = dense_feti.extreme_eigenvalues(narrow.T, narrow.dense.F, narrow.M)
    natural = dense_feti.extreme_eigenvalues(dense_feti.projector(narrow.dense.G), narrow.dense.F, narrow.M)[1]
    assert least > 1 - 1e-8
    assert largest < BOUND / THRESHOLD
    assert natural > 20 * largest


def test_threshold_trades_vectors_for_conditioning(narrow):
    found = []
    for threshold in (0.03, THRESHOLD, 0.5):
        cell = narrow if threshold == THRESHOLD else Narrow(threshold, narrow.dense)
        assert cell.coarse.threshold == threshold
        largest = dense_feti.extreme_eigenvalues(cell.T, cell.dense.F, cell.M)[1]
        assert largest < BOUND / threshold
        found.append((cell.coarse.coarse_dimension, -largest))
    assert found == sorted(found)
    assert found[0][0] < found[1][0] < found[2][0]


# Inactive rows.


def test_states_of_deflation(comm):
    """At first residuals lose P; once rows were inactive, G joins U; few rows, or a breakdown, turn deflation off."""
    cell = torn_cells.tear(comm, **BREAKING)
    coarse, every = cell.solver.coarse, np.ones(cell.solver.rows)
    assert coarse.state is Deflation.ORTHOGONAL and coarse.deflates
    first = coarse.coarse_dimension
    active = masks(cell, [0])[0]
    coarse.activate(active)
    assert coarse.state is Deflation.OBLIQUE
    assert coarse.coarse_dimension == first + coarse.natural.kernel_dimension
    assert coarse.disable_deflation()
    assert coarse.state is Deflation.OFF and not coarse.deflates
    assert not coarse.disable_deflation()
    z = active * np.sin(1.0 + np.arange(len(active)))
    assert (coarse.deflate(z) == coarse.project(z)).all()
    with pytest.raises(RuntimeError, match="deflation is off"):
        _ = coarse.saddle
    coarse.activate(every)
    assert coarse.state is Deflation.OBLIQUE
    demanding = torn_cells.tear(comm, thresholds=Thresholds(rows_per_vector=10**6), **BREAKING)
    assert demanding.solver.coarse.state is Deflation.OFF


def energies(cell, coarse):
    """The coarse matrix of U, dense, and the same by applying F to U."""
    active = cell.solver.active.mask[:, None]
    U = active * coarse.operator.U.toarray()
    expected = cell.comm.allreduce(U.T @ cell.solver.operator.apply(U))
    return allreduce_sparse(cell.comm, coarse.operator.E).toarray(), expected


def test_updated_coarse_matrix_equals_one_from_scratch(comm):
    cell, fresh = torn_cells.tear(comm, **BREAKING), torn_cells.tear(comm, **BREAKING)
    steps = masks(cell, range(3))
    for active in steps:
        cell.solver.activate(active)
        found, expected = energies(cell, cell.solver.coarse)
        assert relative_error(found, expected) < 1e-10
    fresh.solver.activate(steps[-1])
    scratch, _ = energies(fresh, fresh.solver.coarse)
    assert relative_error(found, scratch) < 1e-12
    first, second = (dense_feti.matrix(c, c.solver.coarse.deflate) for c in (cell, fresh))
    assert relative_error(first, second) < 1e-8


def test_deflation_on_active_rows_leaves_what_no_coarse_vector_can_improve(comm):
    """T against a dense one of the active rows; the space is in use, not fallen back from."""
    cell = torn_cells.tear(comm, **BREAKING)
    dense = dense_feti.DenseDual(cell)
    for active in masks(cell, range(2)):
        cell.solver.activate(active)
        on = dense_feti.gathered(cell, active) > 0
        assert 0.05 < (~on).mean() < 0.5
        U = dense_feti.gathered(cell, cell.solver.coarse.operator.U.toarray())[on]
        assert on.sum() > DEFAULTS.rows_per_vector * U.shape[1]
        expected = dense_feti.deflation(dense.F[np.ix_(on, on)], U, dense.G[on])
        T = dense_feti.matrix(cell, lambda z, a=active: cell.solver.coarse.deflate(a[:, None] * z))
        assert (T[~on] == 0).all() and (T[:, ~on] == 0).all()
        assert relative_error(T[np.ix_(on, on)], expected) < 1e-7
        M = dense.preconditioner(on)
        assert relative_error(dense_feti.matrix(cell, cell.solver.preconditioner.apply), M) < 1e-11


@pytest.mark.parametrize(
    ("case", "share"),
    # With few rows the space may give up, and is the natural one but for rounding.
    [(BREAKING, 0.9), (NARROW, 1.1), (NARROW | {"refine": 1}, 0.4)],
    ids=["breaking", "narrow", "refined"],
)
def test_with_inactive_rows_the_solution_is_that_of_the_natural_space(comm, case, share):
    """In that share of the iterations."""
    adaptive, natural = (
        torn_cells.tear(comm, **case, petsc={"feti_coarse_space": space}) for space in ("adaptive", "natural")
    )
    assert isinstance(adaptive.solver.coarse, AdaptiveCoarseSpace)
    assert not isinstance(natural.solver.coarse, AdaptiveCoarseSpace)
    first = solve_many(adaptive)
    steps = masks(adaptive, range(3))
    for active in [*steps, np.ones(len(steps[0]))]:
        for cell in (adaptive, natural):
            cell.solver.activate(active)
        found, expected = (solve_many(c) for c in (adaptive, natural))
        agree(adaptive, found, expected)
        assert found[0].iterations <= share * expected[0].iterations
    agree(adaptive, found, first)


@pytest.mark.parametrize("which", ["one", "all"])
@pytest.mark.parametrize("case", [BREAKING, NARROW], ids=["breaking", "narrow"])
def test_fibres_that_float_keep_the_natural_spaces_solution(comm, case, which):
    """Without contact, fibres whose interface is wholly open; with few rows left the space may give up."""
    results = []
    for space in ("adaptive", "natural"):
        cell = torn_cells.tear(comm, **case, petsc={"feti_coarse_space": space})
        fibre = cell.solver.jump_operator.nodes.fibre
        lowest = comm.allreduce(fibre.min(initial=1000), MPI.MIN)
        status = np.where((fibre == lowest) | (which == "all"), OPEN, BONDED).astype(np.int8)
        cell.solver.activate(torn_cells.interface(cell, False).active(status))
        fibres = len(set().union(*comm.allgather(set(fibre)))) if which == "all" else 1
        assert cell.solver.natural.unconstrained_modes.shape[1] == 3 * fibres
        results.append(solve_many(cell))
    for found, expected in zip(*results, strict=True):
        assert found.reason > 0
        assert relative_error(*(torn_cells.stress(cell, solution) for solution in (found, expected))) < 1e-8
