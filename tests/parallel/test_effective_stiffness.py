"""L^ef of the torn cell against a monolithic solve, closed forms and laws, at any number of ranks."""

from pathlib import Path

import numpy as np
import pytest
from reference.closed_forms import hill_bulk, homogeneous
from support.cases import make_case, monolithic_stiffness, relative_error, solve

from feti_homog.homogenization import partition_policy

pytestmark = pytest.mark.parallel

MESHES = Path(__file__).parents[2] / "meshes"
TIGHT = 1e-9
RANDOM = {"geometry": "random", "fibres": 5, "fibre_fraction": 0.45, "min_gap": 0.15, "seed": 3, "order": 2}


@pytest.mark.quick
@pytest.mark.parametrize(
    ("cell", "pieces"),
    [
        ({"geometry": "hexagonal", "refine": 1}, {"subdomains": 9}),
        ({"geometry": "square"}, {}),
        ({"geometry": "square", "bodies": "plane"}, {"max_dofs": 150}),
        ({"geometry": "hexagonal", "order": 2, "bodies": "plane"}, {}),
        (RANDOM, {"subdomains": 9}),
        (RANDOM, {}),
        (RANDOM | {"bodies": "plane"}, {"max_dofs": 150}),
        ({"geometry": "hexagonal", "interface_size": 0.02}, {}),
    ],
)
def test_torn_cell_has_the_monolithic_stiffness(comm, cell, pieces):
    torn, L, responses = solve(make_case(decomposition=pieces, **cell), comm)
    assert relative_error(L, monolithic_stiffness(torn)) < TIGHT
    assert all(r.state.solution.reason > 0 for r in responses)
    assert max(max(r.checks.values()) for r in responses) < 1e-8


@pytest.mark.one_rank
def test_a_users_mesh_in_plane_stress_has_the_monolithic_stiffness(comm):
    case = make_case(geometry="mesh", file="two_fibres.msh", folder=MESHES, refine=1, plane="stress")
    torn, L, _ = solve(case, comm)
    assert relative_error(L, monolithic_stiffness(torn)) < TIGHT


@pytest.mark.parametrize("preconditioner", ["none", "lumped"])
def test_preconditioner_changes_only_the_iterations(comm, preconditioner):
    petsc = {"feti_pc_type": preconditioner, "feti_ksp_rtol": 1e-11}
    _, L, _ = solve(make_case(petsc=petsc), comm)
    _, expected, _ = solve(make_case(), comm)
    assert relative_error(L, expected) < TIGHT


@pytest.mark.parametrize("option", ["feti_sub_pc_factor_mat_solver_type", "feti_interior_pc_factor_mat_solver_type"])
def test_mumps_gives_the_stiffness_of_cholmod(comm, option):
    _, L, _ = solve(make_case(petsc={option: "mumps"}), comm)
    _, expected, _ = solve(make_case(), comm)
    assert relative_error(L, expected) < TIGHT


def test_an_isotropic_phase_has_the_same_elements_in_either_form(comm):
    transverse = {"E_axial": 1.0, "E_transverse": 1.0, "nu_axial": 0.4999, "nu_transverse": 0.4999}
    forms, fibre = ({"young": 1.0, "poisson": 0.4999}, transverse), {"young": 1000.0, "poisson": 0.3}
    first, second = (solve(make_case(matrix=form, fibre=fibre, order=2), comm)[1] for form in forms)
    assert relative_error(second, first) < 1e-7


@pytest.mark.one_rank
@pytest.mark.parametrize("plane", ["strain", "stress"])
@pytest.mark.parametrize("order", [1, 2])
def test_homogeneous_cell_is_exact(comm, order, plane):
    material = {"E1": 10.0, "E2": 2.0, "E3": 3.0, "nu12": 0.3, "nu13": 0.25, "nu23": 0.2, "G12": 1.5, "angle": 25.0}
    case = make_case(matrix=material, fibre=material, order=order, plane=plane, mesh_size=0.2)
    _, L, _ = solve(case, comm)
    expected = homogeneous(material, plane)
    assert np.abs(L - expected).max() <= 1e-10 * np.abs(expected).max()


@pytest.mark.one_rank
@pytest.mark.parametrize("cell", [{"geometry": "square"}, {"geometry": "hexagonal", "fibre_fraction": 0.6}])
def test_equal_shear_moduli_obey_hill(comm, cell):
    """sum c_i / (k_i + mu) = 1 / (k* + mu), exact for any geometry (Hill 1964)."""
    mu, k = 30.0, np.array([50.0, 170.0])
    # E and nu of plane bulk modulus k = lambda + mu and shear modulus mu in plane strain.
    nu = (k - mu) / (2 * k)
    phases = [{"young": 2 * mu * (1 + n), "poisson": n} for n in nu]
    torn, L, _ = solve(
        make_case(matrix=phases[0], fibre=phases[1], order=2, refine=1, **{"mesh_size": 0.1} | cell), comm
    )
    areas = torn.areas()
    c = np.array([areas["matrix"], areas["fibre"]]) / torn.summary.area
    expected = hill_bulk(k, mu, c)
    assert abs((L[0, 0] + L[0, 1]) / 2 - expected) < 2e-6 * expected
    assert abs(L[2, 2] - mu) < 2e-6 * mu


@pytest.mark.parametrize("contrast", [1e-4, 1e6])
def test_stiffness_is_monolithic_at_any_contrast(comm, contrast):
    fibre = {"young": contrast, "poisson": 0.3}
    case = make_case(matrix={"young": 1.0, "poisson": 0.3}, fibre=fibre, decomposition={"subdomains": 6})
    torn, L, responses = solve(case, comm)
    assert all(r.state.solution.reason > 0 for r in responses)
    assert relative_error(L, monolithic_stiffness(torn)) < 1e-7


@pytest.mark.parametrize("contrast", [1e-3, 1e6])
def test_nearly_incompressible_pieces_are_monolithic_in_few_iterations(comm, contrast):
    """Beside fibres as stiff as the diagonal of its K, a matrix is softer than it by the factor lambda / mu."""
    fibre, cell = {"young": contrast, "poisson": 0.3}, {"mesh_size": 0.1, "decomposition": {"subdomains": 8}}
    torn, L, responses = solve(make_case(matrix={"young": 1.0, "poisson": 0.49999}, fibre=fibre, **cell), comm)
    assert max(r.state.solution.iterations for r in responses) <= 25
    assert relative_error(L, monolithic_stiffness(torn)) < 1e-9


@pytest.mark.one_rank
def test_rounding_in_the_coarse_space_costs_few_iterations(comm):
    """Nearly incompressible pieces have coarse vectors that nearly depend on each other."""
    matrix, cell = {"young": 88.0, "poisson": 0.4999}, {"geometry": "square", "order": 2, "refine": 1, "mesh_size": 0.1}
    torn, L, responses = solve(make_case(matrix=matrix, decomposition={"subdomains": 4}, **cell), comm)
    assert all(r.state.solution.reason > 0 for r in responses)
    assert max(r.state.solution.iterations for r in responses) < 40
    assert relative_error(L, monolithic_stiffness(torn)) < 1e-7


def test_dual_operator_is_symmetric_and_positive_and_the_projector_idempotent(comm):
    torn, _, _ = solve(make_case(geometry="hexagonal", decomposition={"subdomains": 7}), comm)
    solver = torn.solver
    first, last = solver.jump_operator.owned
    rows = solver.jump_operator.global_rows
    x, y = (np.random.default_rng(seed).standard_normal(rows)[first:last] for seed in (1, 2))

    def dot(a, b):
        return comm.allreduce(a @ b)

    Fx, Fy = solver.operator.apply(x), solver.operator.apply(y)
    assert abs(dot(x, Fy) - dot(y, Fx)) < 1e-11 * abs(dot(x, Fx))
    for v in (x, y):
        v[:] = solver.natural.project(v)
    once = x.copy()
    x[:] = solver.natural.project(x)
    assert dot(x - once, x - once) < 1e-24 * dot(once, once)
    along = comm.allreduce(solver.natural.G.T @ x)
    assert along @ along < 1e-22 * dot(x, x)
    assert dot(x, solver.operator.apply(x)) > 0
    Mx, My = solver.preconditioner.apply(x), solver.preconditioner.apply(y)
    assert abs(dot(x, My) - dot(y, Mx)) < 1e-10 * abs(dot(x, Mx))
    assert dot(x, Mx) > 0


@pytest.mark.parametrize("plane", ["strain", "generalized"])
def test_estimates_count_the_solves_that_are_done(comm, plane):
    case = make_case(plane=plane)
    cell, *_ = solve(case, comm)
    assert (
        partition_policy.applications(case, cell.solver.problem)
        == cell.solver.solves * partition_policy.ITERATIONS_OF_A_SOLVE
    )
