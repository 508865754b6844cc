"""L^ef against reference numbers and closed forms: errors, rates, slopes and iterations, at any number of ranks."""

from pathlib import Path

import numpy as np
import pytest
from reference.closed_forms import bulk_and_shear, cubic, dilute_slopes, laminate
from reference.references import BONDED, NEARLY_INCOMPRESSIBLE
from support.cases import MATRIX, make_case, relative_error, solve
from support.ranks import write_once
from unit.mesh.faulty_meshes import grid

pytestmark = [pytest.mark.parallel, pytest.mark.few_ranks]

MESHES = Path(__file__).parents[2] / "meshes"

# Refinements of one coarse mesh, the error that the last one must reach, the rate that all must show.
LADDERS = {1: (range(1, 4), 1e-4, 1.8), 2: (range(3), 2e-6, 3.5)}


def entry_errors(L, expected):
    """(3, 3) errors relative to each entry; of the zeros, to C11."""
    return np.abs(L - expected) / np.where(expected > 0, expected, expected[0, 0])


@pytest.mark.one_rank
@pytest.mark.parametrize("order", LADDERS)
@pytest.mark.parametrize(("geometry", "plane"), [("square", "stress"), ("hexagonal", "strain")])
def test_errors_fall_with_twice_the_order_of_the_elements(comm, geometry, plane, order):
    """|L^ef(h) - L^ef| = O(h^2p) for elements of order p, and every entry reaches the reference."""
    (refinements, least, slowest), expected = LADDERS[order], cubic(*BONDED[geometry, plane].value)
    cells = ({"geometry": geometry, "order": order, "refine": k, "mesh_size": 0.1} for k in refinements)
    found = [solve(make_case(plane=plane, **cell), comm)[1] for cell in cells]
    assert entry_errors(found[-1], expected).max() <= least
    errors = [relative_error(L, expected) for L in found]
    rate = -np.polyfit(np.arange(3), np.log2(errors), 1)[0]
    assert slowest < rate < 2 * order + 0.5, (rate, errors)


@pytest.mark.one_rank
@pytest.mark.parametrize("poisson", NEARLY_INCOMPRESSIBLE)
def test_errors_of_nearly_incompressible_cells_fall_as_those_of_others(comm, poisson):
    phases = {"matrix": {"young": 1.0, "poisson": poisson}, "fibre": {"young": 1e3, "poisson": 0.3}}
    found = [solve(make_case(**phases, refine=k, mesh_size=0.12), comm)[1][[0, 0, 2], [0, 1, 2]] for k in range(3)]
    bulk, _, shear = np.abs(found / np.array(NEARLY_INCOMPRESSIBLE[poisson].value) - 1).T
    assert (np.log2(shear[:-1] / shear[1:]) > [3.2, 3.6]).all(), shear
    assert shear[-1] < 3e-5 and bulk[-1] < 3e-7


@pytest.mark.one_rank
@pytest.mark.parametrize("young", [200.0, 1e-4], ids=["stiff", "nearly void"])
def test_dilute_slopes_are_the_closed_form(comm, young):
    fibre = {"young": young, "poisson": 0.222}
    expected = dilute_slopes(MATRIX, fibre)
    slopes = []
    for c in (0.01, 0.005):
        case = make_case(geometry="square", fibre=fibre, fibre_fraction=c, mesh_size=0.1, order=2, refine=1)
        torn, L, _ = solve(case, comm)
        fraction = torn.areas()["fibre"] / torn.summary.area
        bulk, shear = (L[0, 0] + L[0, 1]) / 2, ((L[0, 0] - L[0, 1]) / 2 + L[2, 2]) / 2
        slopes.append((np.array([bulk, shear]) - bulk_and_shear(MATRIX)) / fraction)
    extrapolated = 2 * slopes[1] - slopes[0]
    assert np.abs(extrapolated / expected - 1).max() < 2e-3, (extrapolated, expected)


@pytest.mark.parametrize(("order", "across"), [(1, 0), (2, 1)])
def test_laminate_is_exact(comm, shared_path, across, order):
    """Strips of a quarter fibre, normal to x1 or x2."""
    write_once(comm, grid(lambda x, y: 0.25 < (x, y)[across] < 0.5), shared_path / "strips.msh")
    matrix, fibre = [[10, 3, 1], [3, 5, -0.5], [1, -0.5, 2]], [[40, 8, -4], [8, 90, 6], [-4, 6, 15]]
    cell = {"geometry": "mesh", "file": "strips.msh", "folder": shared_path, "order": order}
    _, found, _ = solve(make_case(**cell, matrix={"stiffness": matrix}, fibre={"stiffness": fibre}), comm)
    assert relative_error(found, laminate(np.array([matrix, fibre]), [0.75, 0.25], across)) < 1e-10


@pytest.mark.parametrize(("geometry", "order"), [("square", 1), ("hexagonal", 2)])
def test_stiffness_of_a_users_mesh_reaches_the_reference(comm, geometry, order):
    case = make_case(geometry="mesh", file=f"{geometry}.msh", folder=MESHES, order=order, refine=2 // order)
    _, L, _ = solve(case, comm)
    assert entry_errors(L, cubic(*BONDED[geometry, "strain"].value)).max() < {1: 3e-4, 2: 1e-5}[order]


@pytest.mark.parametrize(("order", "refine"), [(1, 1), (2, 0), (2, 2)])
def test_iterations_do_not_grow_with_refinement(comm, order, refine):
    """Hexagonal cell, bodies on the torus, from 5 000 to 80 000 degrees of freedom."""
    case = make_case(mesh_size=0.062, order=order, refine=refine + 2 - order, decomposition={"subdomains": 1})
    torn, _, responses = solve(case, comm)
    assert torn.summary.subdomains == 3
    assert torn.comm.allreduce(sum(s.n_dofs for s in torn.subdomains)) == pytest.approx(5_000 * 4**refine, rel=0.2)
    assert max(r.state.iterations for r in responses) <= 14
