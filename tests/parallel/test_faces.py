"""Soft modes of bodies too large to be one eigenproblem: by the neighbourhoods of their faces."""

import numpy as np
import pytest
from mpi4py import MPI
from reference import dense_feti
from support import torn_cells
from support.cases import make_case, monolithic_stiffness, relative_error, solve
from support.coarse_space_cells import NARROW, agree, masks, of_all, solve_many

from feti_homog.feti.coarse.face_neighbourhoods import face_neighbourhoods
from feti_homog.feti.decomposition.interface_neighbours import Neighbours
from feti_homog.feti.thresholds import Thresholds

pytestmark = pytest.mark.parallel

# The matrix is left whole.
WHOLE = NARROW | {"decomposition": {"subdomains": 17}}
CASES = {
    "whole": WHOLE,
    "plane, quadratic": {"geometry": "hexagonal", "mesh_size": 0.2, "order": 2, "bodies": "plane"},
}
TIGHT = 1e-9
# Nearly all whole bodies are examined face by face.
FACEWISE = Thresholds(whole_boundary_dofs=30)


@pytest.fixture(scope="module", params=CASES.values(), ids=CASES.keys())
def faces(request):
    """(subdomain, boundary dofs, S, face, its neighbourhoods) of all pairs of neighbours."""
    comm = MPI.COMM_WORLD
    cell = torn_cells.tear(comm, **request.param, petsc={"feti_coarse_space": "natural"})
    solver, operators, found = cell.solver, cell.solver.interface_operators, []
    neighbours = Neighbours(comm, solver.jump_operator, cell.subdomains)
    for i, s in enumerate(cell.subdomains):
        B, dofs = operators.B[:, operators.slices[i]], operators.dofs[i]
        S = dense_feti.schur(s.assemble_stiffness().toarray(), dofs)
        for other, common in neighbours.common[i].items():
            if other != s.submesh.index:
                nodes = np.unique(B[neighbours.rows[i][common]].indices // s.problem.components)
                face = s.problem.dofs(nodes)
                found.append((s, dofs, S, face, face_neighbourhoods(s, dofs, face)))
    return found


# Neighbourhoods.


def test_the_energy_of_a_body_lies_between_those_of_neighbourhoods(comm, faces):
    covered = np.zeros(2)
    for *_, S, face, found in faces:
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


def test_kernels_of_neighbourhoods_are_the_null_spaces_of_their_stiffness(comm, faces):
    kernels = set()
    for *_, found in faces:
        for near in found:
            S = near.operator.S
            assert np.abs(S @ near.R).max(initial=0.0) < TIGHT * np.abs(S).max()
            assert dense_feti.kernel(S).shape[1] == near.R.shape[1]
            assert np.linalg.eigvalsh(near.operator.regularised_schur)[0] > 0
            kernels.add(near.R.shape[1])
    assert 3 in set().union(*comm.allgather(kernels))


def test_a_neighbourhood_of_the_whole_body_is_as_stiff(faces):
    for s, dofs, S, face, _ in faces:
        if len(face) < 4:  # a single node
            continue
        (near,) = face_neighbourhoods(s, dofs, face, Thresholds(face_layers=100))
        expected = np.zeros_like(S)
        expected[np.ix_(face, face)] = dense_feti.schur(S, face)
        found = np.zeros_like(S)
        found[np.ix_(near.at, near.at)] = near.operator.S
        assert relative_error(found, expected) < TIGHT


# Solutions.


@pytest.mark.parametrize("contrast", [1e-3, 1e6])
def test_iterations_stay_few_at_any_contrast(comm, contrast):
    case = WHOLE | {
        "matrix": {"young": 1.0, "poisson": 0.3}, "fibre": {"young": contrast, "poisson": 0.3},
        "petsc": {"feti_ksp_rtol": 1e-8, "feti_coarse_space": "adaptive"},
    }  # fmt: skip
    torn, L, responses = solve(make_case(**case), comm, FACEWISE)
    assert torn.solver.adaptive is not None
    assert comm.allreduce(any(torn.solver.interface_operators.facewise), MPI.LOR)
    assert all(r.state.solution.reason > 0 for r in responses)
    assert max(r.state.iterations for r in responses) <= 25
    assert relative_error(L, monolithic_stiffness(torn)) < 1e-7


@pytest.mark.one_rank
def test_a_whole_matrix_converges_as_with_one_eigenproblem(comm):
    """Compare modes by faces, of a whole body, and rigid-body motions alone; faces give a few more modes."""
    case = WHOLE | {"refine": 1, "min_gap": 0.01, "fibre_fraction": 0.65}
    iterations, vectors = [], []
    for whole, space in ((300, "adaptive"), (4000, "adaptive"), (4000, "natural")):
        thresholds = Thresholds(whole_boundary_dofs=whole)
        cell = torn_cells.tear(
            comm, **case, thresholds=thresholds, petsc={"feti_coarse_space": space, "feti_ksp_rtol": 1e-8}
        )
        iterations.append(solve_many(cell)[0].iterations)
        vectors.append(cell.solver.coarse_dimension)
    assert iterations[0] <= iterations[1] + 5
    assert max(iterations[:2]) <= 25 < iterations[2] / 1.5
    assert vectors[2] < vectors[1] < vectors[0] < 2 * vectors[1]


def test_soft_modes_and_stress_do_not_depend_on_the_ranks(comm):
    found = []
    for some in (comm, MPI.COMM_SELF):
        cell = torn_cells.tear(some, **WHOLE, thresholds=FACEWISE, petsc={"feti_coarse_space": "adaptive"})
        solution = cell.solver.solve(np.array([1.0, -0.5, 0.3]), np.zeros(cell.solver.rows))
        found.append((of_all(some, cell.solver.adaptive, cell), solution.iterations, torn_cells.stress(cell, solution)))
    (soft_modes, iterations, stress), (of_one, iterations_of_one, stress_of_one) = found
    assert soft_modes == of_one
    assert abs(iterations - iterations_of_one) <= 1
    assert relative_error(stress, stress_of_one) < 1e-9


def test_with_inactive_rows_the_solution_is_that_of_the_natural_space(comm):
    adaptive, natural = (
        torn_cells.tear(comm, **WHOLE, refine=1, thresholds=FACEWISE, petsc={"feti_coarse_space": space})
        for space in ("adaptive", "natural")
    )
    assert adaptive.solver.adaptive is not None
    for active in masks(adaptive, range(2)):
        for cell in (adaptive, natural):
            cell.solver.set_state(active, cell.solver.intact_compliance)
        agree(adaptive, *(solve_many(cell) for cell in (adaptive, natural)))
