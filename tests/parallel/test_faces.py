"""Soft modes of bodies too large for one eigenproblem: by the neighbourhoods of their faces."""

from __future__ import annotations

import bonds
import numpy as np
import pytest
from cells import make_case, relative_error, solve, twin_stiffness
from mpi4py import MPI
from narrow_cells import NARROW, agree, masks, of_all, solve_many
from reference import dense_feti

from feti_homog.feti.coarse.adaptive import AdaptiveCoarseSpace
from feti_homog.feti.coarse.face_neighbourhoods import face_neighbourhoods
from feti_homog.feti.decomposition.neighbours import Neighbours
from feti_homog.feti.decomposition.subdomain import both_directions
from feti_homog.feti.thresholds import MIN_FACE_NODES, Thresholds

pytestmark = pytest.mark.parallel

# The matrix is left whole.
WHOLE = NARROW | {"decomposition": {"subdomains": 17}}
CASES = {
    "whole": WHOLE,
    "all cut": NARROW | {"decomposition": {"subdomains": 50}},
    "plane, quadratic": {"geometry": "hexagonal", "mesh_size": 0.2, "order": 2, "bodies": "plane"},
}
TIGHT = 1e-9
# Nearly all boundaries are searched face by face.
FACE_BY_FACE = Thresholds(whole_boundary_dofs=30)


@pytest.fixture(params=CASES.values(), ids=CASES.keys())
def faces(request, comm):
    """(subdomain, boundary dofs, S, face) of all pairs of neighbours."""
    cell = bonds.tear(comm, **request.param, petsc={"feti_coarse_space": "natural"})
    solver, operators, found = cell.solver, cell.solver.interface_operators, []
    neighbours = Neighbours(comm, solver.jump_operator, cell.subdomains)
    for i, s in enumerate(cell.subdomains):
        B, dofs = operators.B[:, operators.spans[i]], operators.dofs[i]
        S = dense_feti.schur(s.K.toarray(), dofs)
        for other, common in neighbours.common[i].items():
            if other != s.submesh.index:
                nodes = np.unique(B[neighbours.rows[i][common]].indices // 2)
                found.append((s, dofs, S, both_directions(nodes)))
    return found


# Neighbourhoods.


def test_the_energy_of_a_body_lies_between_those_of_neighbourhoods(comm, faces):
    covered = np.zeros(2)
    for s, dofs, S, face in faces:
        found = face_neighbourhoods(s, dofs, face)
        at = np.concatenate([np.zeros(0, int), *(near.at for near in found)])
        assert set(at) <= set(face)
        covered += [len(set(at)), len(face)]
        rest = S.copy()
        for near in found:
            rest[np.ix_(near.at, near.at)] -= near.operator.S
            more = near.S_fixed - S[np.ix_(near.at, near.at)]
            assert np.linalg.eigvalsh(more)[0] > -TIGHT * np.abs(S).max()
        assert np.linalg.eigvalsh(rest)[0] > -TIGHT * np.abs(S).max()
    examined, whole = comm.allreduce(covered)
    assert examined > 0.9 * whole


def test_kernels_of_neighbourhoods(comm, faces):
    kernels = set()
    for s, dofs, _, face in faces:
        for near in face_neighbourhoods(s, dofs, face):
            S = near.operator.S
            assert np.abs(S @ near.R).max(initial=0.0) < TIGHT * np.abs(S).max()
            assert dense_feti.kernel(S).shape[1] == near.R.shape[1]
            assert np.linalg.eigvalsh(near.operator.held)[0] > 0
            kernels.add(near.R.shape[1])
    assert 3 in set().union(*comm.allgather(kernels))


def test_a_neighbourhood_of_the_whole_body_is_as_stiff(faces):
    for s, dofs, S, face in faces:
        if len(face) < 2 * MIN_FACE_NODES:
            continue
        (near,) = face_neighbourhoods(s, dofs, face, Thresholds(face_layers=100))
        expected = np.zeros_like(S)
        expected[np.ix_(face, face)] = dense_feti.schur(S, face)
        found = np.zeros_like(S)
        found[np.ix_(near.at, near.at)] = near.operator.S
        assert relative_error(found, expected) < TIGHT


# Solutions.


@pytest.mark.parametrize("contrast", [1e-3, 2.0, 1e6])
def test_contrasts_converge_fast(comm, contrast):
    case = WHOLE | {
        "matrix": {"young": 1.0, "poisson": 0.3}, "fibre": {"young": contrast, "poisson": 0.3},
        "petsc": {"feti_ksp_rtol": 1e-8, "feti_coarse_space": "adaptive"},
    }  # fmt: skip
    torn, L, responses = solve(make_case(**case), comm, FACE_BY_FACE)
    assert isinstance(torn.solver.coarse, AdaptiveCoarseSpace)
    assert comm.allreduce(any(torn.solver.interface_operators.large), MPI.LOR)
    assert all(r.state.solution.reason > 0 for r in responses)
    assert max(r.state.iterations for r in responses) <= 25
    assert relative_error(L, twin_stiffness(torn)) < 1e-7


def test_a_whole_matrix_converges_as_with_one_eigenproblem(comm):
    """By faces, in one, and with rigid-body motions alone; a few more modes come by faces."""
    case = WHOLE | {"refine": 1, "min_gap": 0.01, "fibre_fraction": 0.65}
    iterations, vectors = [], []
    for whole, space in ((300, "adaptive"), (4000, "adaptive"), (4000, "natural")):
        petsc = {"feti_coarse_space": space, "feti_ksp_rtol": 1e-8}
        cell = bonds.tear(comm, thresholds=Thresholds(whole_boundary_dofs=whole), **case, petsc=petsc)
        iterations.append(solve_many(cell)[0].iterations)
        vectors.append(cell.solver.coarse.coarse_dimension)
    assert iterations[0] <= iterations[1] + 5
    assert max(iterations[:2]) <= 25 < iterations[2] / 1.5
    assert vectors[2] < vectors[1] < vectors[0] < 2 * vectors[1]


def test_ranks_do_not_matter(comm):
    found = []
    for some in (comm, MPI.COMM_SELF):
        cell = bonds.tear(some, thresholds=FACE_BY_FACE, **WHOLE, petsc={"feti_coarse_space": "adaptive"})
        solution = cell.solver.solve(np.array([1.0, -0.5, 0.3]), np.zeros(cell.solver.rows))
        found.append((of_all(some, cell.solver.coarse, cell), solution.iterations, bonds.stress(cell, solution)))
    (soft_modes, iterations, stress), (of_one, iterations_of_one, stress_of_one) = found
    assert soft_modes == of_one
    assert abs(iterations - iterations_of_one) <= 1
    assert relative_error(stress, stress_of_one) < 1e-9


def test_inactive_rows_give_the_natural_spaces_solution(comm):
    adaptive, natural = (
        bonds.tear(comm, thresholds=FACE_BY_FACE, **WHOLE, refine=1, petsc={"feti_coarse_space": space})
        for space in ("adaptive", "natural")
    )
    assert isinstance(adaptive.solver.coarse, AdaptiveCoarseSpace)
    for active in masks(adaptive, range(2)):
        for cell in (adaptive, natural):
            cell.solver.activate(active)
        agree(adaptive, *(solve_many(cell) for cell in (adaptive, natural)))
