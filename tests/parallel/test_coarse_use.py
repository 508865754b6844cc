"""Solutions with the adaptive coarse space, and its options."""

import re

import numpy as np
import pytest
from mpi4py import MPI
from reference import dense_feti
from support import torn_cells
from support.cases import case_of, make_case, monolithic_stiffness, relative_error, solve
from support.coarse_space_cells import BOUND, BREAKING, NARROW, STRAINS, of_all, solve_many

from feti_homog import ConvergenceError, run
from feti_homog.feti.thresholds import DEFAULTS

pytestmark = pytest.mark.parallel

THRESHOLD = DEFAULTS.soft_mode


# Solutions.


def test_loads_solved_together_give_the_solutions_of_each_alone(narrow):
    solver = narrow.solver
    strains = np.array([[1.0, 0, 0], [0.2, -3.0, 1e-3], [0, 0, 1e-4]])
    starts = narrow.own(narrow.random(4, (3,))) * [0.0, 1e-2, 0.0]
    solutions = solve_many(narrow.cell, strains, starts)
    for strain, start, found in zip(strains, starts.T, solutions, strict=True):
        (alone,) = solve_many(narrow.cell, strain[None], start[:, None])
        assert alone.reason > 0 and found.reason > 0
        assert (found.strain == strain).all()
        assert relative_error(*(dense_feti.gathered(narrow.cell, s.lam) for s in (found, alone))) < 1e-7
        assert relative_error(*(solver.stress_integral(s) for s in (found, alone))) < 1e-9
        assert abs(found.iterations - alone.iterations) <= 4


def test_a_load_without_multipliers_leaves_the_others_alone(narrow):
    zero, found = solve_many(narrow.cell, np.array([[0.0, 0, 0], [1.0, 0, 0]]))
    assert (zero.lam == 0).all()
    (alone,) = solve_many(narrow.cell, STRAINS[:1])
    assert relative_error(*(dense_feti.gathered(narrow.cell, s.lam) for s in (found, alone))) < 1e-7


def test_soft_modes_and_stress_do_not_depend_on_the_ranks(comm):
    """Compare a cell on all ranks with the same cell on one."""
    found = []
    for some in (comm, MPI.COMM_SELF):
        cell = torn_cells.tear(some, **NARROW)
        solution = cell.solver.solve(np.array([1.0, -0.5, 0.3]), np.zeros(cell.solver.rows))
        soft = of_all(some, cell.solver.adaptive, cell)
        found.append((cell.solver.coarse_dimension, soft, solution.iterations, torn_cells.stress(cell, solution)))
    (vectors, soft, iterations, stress), (of_one, soft_of_one, iterations_of_one, stress_of_one) = found
    assert vectors == of_one
    assert soft == soft_of_one
    assert abs(iterations - iterations_of_one) <= 1
    assert relative_error(stress, stress_of_one) < 1e-9


@pytest.mark.parametrize(("contrast", "pieces"), [(1e-3, 24), (1e6, 50)], ids=["soft, matrix cut", "stiff, all cut"])
def test_iterations_stay_few_at_any_contrast(comm, contrast, pieces):
    case = NARROW | {
        "matrix": {"young": 1.0, "poisson": 0.3}, "fibre": {"young": contrast, "poisson": 0.3},
        "petsc": {"feti_ksp_rtol": 1e-8}, "decomposition": {"subdomains": pieces},
    }  # fmt: skip
    torn, L, responses = solve(make_case(**case), comm)
    assert torn.solver.adaptive is not None
    assert all(r.state.solution.reason > 0 for r in responses)
    assert max(r.state.iterations for r in responses) <= 30
    # The tolerance is on the three load cases together.
    assert max(r.state.solution.residual for r in responses) <= np.sqrt(3) * 1e-8
    assert relative_error(L, monolithic_stiffness(torn)) < 1e-7


# Options.


@pytest.mark.parametrize(
    ("case", "petsc", "adaptive"),
    [
        (BREAKING, {}, True),
        (BREAKING, {"feti_coarse_space": "natural"}, False),
        ({"geometry": "hexagonal"}, {"feti_coarse_space": "adaptive"}, True),
        ({"geometry": "hexagonal", "decomposition": {"subdomains": 1}}, {}, False),
        (BREAKING, {"feti_dual_operator": "implicit"}, False),
        (BREAKING, {"feti_pc_type": "lumped"}, False),
    ],
)
def test_the_coarse_space_is_the_one_asked_for_or_that_pays(comm, case, petsc, adaptive):
    solver = torn_cells.tear(comm, **case, petsc=petsc).solver
    assert (solver.adaptive is not None) == adaptive


MULTIGRID = {
    "feti_coarse_ksp_type": "cg", "feti_coarse_ksp_rtol": 1e-10, "feti_coarse_pc_type": "gamg",
    "feti_coarse_mg_levels_pc_type": "sor",
}  # fmt: skip


def test_a_coarse_problem_solved_by_multigrid_gives_the_same(comm):
    case = NARROW | {"fibre": {"young": 3e6, "poisson": 0.3}, "decomposition": {"subdomains": 50}}
    found = []
    for options in ({}, MULTIGRID):
        cell = torn_cells.tear(comm, **case, petsc=options)
        found.append(solve_many(cell))
        assert (cell.solver.adaptive.solver.iterations > 1) == (options is MULTIGRID)
    for one, other in zip(*found, strict=True):
        assert one.reason > 0 and other.reason > 0 and abs(one.iterations - other.iterations) <= 1
        assert relative_error(*(dense_feti.gathered(cell, s.lam) for s in (one, other))) < 1e-7


def test_translations_of_the_cell_have_little_energy(comm, narrow):
    """Translations meet a resistance at the pinned class alone."""
    part, translations = narrow.coarse.part(), narrow.coarse._translations
    energy, bound = (
        comm.allreduce(np.einsum("ik,ik->k", translations, product))
        for product in (part @ translations, part.diagonal()[:, None] * translations)
    )
    assert translations.shape[1] == 2
    assert (energy < 0.05 * bound).all()


def test_kernels_are_projected_as_least_squares_do(comm):
    """With all rows, with every seventh one away, and with none on the first fibre, which then can move freely."""
    cell = torn_cells.tear(comm, **BREAKING)
    natural, rows = cell.solver.natural, cell.solver.rows
    first = cell.solver.jump_operator.owned[0]
    number = np.arange(first, first + rows)
    nodes = cell.solver.jump_operator.nodes
    free = np.ones(rows)
    for row in nodes.row[nodes.fibre == cell.summary.fibre_bodies[0]]:
        free[row : row + 2] = 0.0
    for active in (np.ones(rows), (number % 7 > 0).astype(float), free):
        natural.activate(active)
        x = active * np.cos(number + 1.0)
        projected = natural.project(x)
        G, whole, found = (dense_feti.gathered(cell, y) for y in (natural.G_active.toarray(), x, projected))
        expected = whole - G @ np.linalg.lstsq(G, whole, rcond=1e-10)[0]
        assert np.abs(found - expected).max() < 1e-10
        amplitudes = natural.amplitudes(x)
        np.testing.assert_allclose(x - natural.G_active @ amplitudes, projected, atol=1e-12)
    assert natural.unconstrained_modes.shape[1] > 0
    cell.destroy()


def number(pattern, text):
    return float(re.search(pattern + r" ([\d.e+]+)", text)[1])


def test_view_shows_the_adaptive_space_and_the_condition_number(comm, narrow, capfd):
    cell, text = torn_cells.printed(comm, capfd, **NARROW, petsc={"feti_view": True})
    assert number("coarse dimension", text) == narrow.solver.coarse_dimension
    assert number("kernels:", text) == narrow.solver.natural.kernel_dimension
    assert number("soft modes below", text) == THRESHOLD
    soft = narrow.solver.coarse_dimension - narrow.solver.natural.kernel_dimension
    assert f"soft modes below {THRESHOLD:g}: {soft}," in text
    assert f"{cell.summary.subdomains} subdomains, {cell.summary.subdomains} with dense boundary operators" in text
    least, largest = dense_feti.extreme_eigenvalues(narrow.dense.F, narrow.H)
    assert 0.7 * largest / least < number("condition number about", text) < 1.01 * largest / least
    assert cell.solver.condition == pytest.approx(number("condition number about", text), rel=5e-3)


def test_view_shows_the_natural_space_without_soft_modes(comm, narrow, capfd):
    _, text = torn_cells.printed(comm, capfd, **NARROW, petsc={"feti_view": True, "feti_coarse_space": "natural"})
    assert number("coarse dimension", text) == narrow.solver.natural.kernel_dimension
    assert "soft modes" not in text
    assert number("condition number about", text) > 10 * BOUND / THRESHOLD


def test_other_methods_have_no_condition_number(comm, capfd):
    """GMRES estimates singular values in a norm in which the operator is not symmetric."""
    cell, text = torn_cells.printed(comm, capfd, **NARROW, petsc={"feti_view": True, "feti_ksp_type": "gmres"})
    assert "iterations" in text and "condition number" not in text and not cell.solver.condition


def test_restarts_count_towards_the_permitted_iterations(comm):
    inner = {"ksp_type": "cg", "pc_type": "gamg", "ksp_rtol": 1e-2}
    petsc = {f"feti_natural_{name}": value for name, value in inner.items()} | {"feti_ksp_max_it": 40}
    hexagonal = {"geometry": "hexagonal", "fibre_fraction": 0.4, "mesh_size": 0.1}
    with pytest.raises(ConvergenceError) as caught:
        run(case_of(hexagonal, petsc=petsc, decomposition={"cut": "bodies"}), comm)
    assert 0 < max(caught.value.result.solver.iterations) <= 40  # on one rank 40


def test_nothing_is_printed_unasked(comm, capfd):
    assert torn_cells.printed(comm, capfd, **BREAKING)[1] == ""
