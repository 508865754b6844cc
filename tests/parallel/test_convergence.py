"""L^ef against reference numbers and closed forms: errors, rates, slopes and iterations, at any number of ranks."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from cells import FIBRE, MATRIX, make_case, relative_error, solve, twin_stiffness
from mpi4py import MPI
from unit.cell.faulty_meshes import grid

pytestmark = pytest.mark.parallel

MESHES = Path(__file__).parents[2] / "meshes"

# C11, C12, C33 at a fibre fraction of 0.4: Fourier solutions whose truncations agree to 2e-9.
REFERENCE = {
    ("square", "strain"): (151.155859, 55.537426, 45.078553),
    ("square", "stress"): (128.862996, 34.070020, 45.000421),
    ("hexagonal", "strain"): (149.690255, 56.975975, 46.357140),
    ("hexagonal", "stress"): (127.573943, 35.321585, 46.126179),
}
CELLS = pytest.mark.parametrize(("geometry", "plane"), REFERENCE)
# Refinements of one coarse mesh, the error that the last one must reach, the rate that the last three must show.
LADDERS = {1: (range(4), 1e-4, 1.8), 2: (range(3), 2e-6, 3.5)}


def cubic(c11, c12, c33):
    """(3, 3) stiffness of square symmetry."""
    return np.array([[c11, c12, 0.0], [c12, c11, 0.0], [0.0, 0.0, c33]])


def entry_errors(L, expected):
    """(3, 3) errors relative to each entry; of the zeros, to C11."""
    return np.abs(L - expected) / np.where(expected > 0, expected, expected[0, 0])


def lame(material):
    """Lame constants in plane strain."""
    E, nu = material["young"], material["poisson"]
    return E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))


@cache
def ladder(geometry, plane, order):
    """L^ef of the refinements of the ladder; collective."""
    cells = ({"geometry": geometry, "order": order, "refine": k, "mesh_size": 0.1} for k in LADDERS[order][0])
    return [solve(make_case(plane=plane, **cell), MPI.COMM_WORLD)[1] for cell in cells]


@pytest.mark.parametrize("order", LADDERS)
@CELLS
def test_every_entry_reaches_the_reference(geometry, plane, order):
    errors = entry_errors(ladder(geometry, plane, order)[-1], cubic(*REFERENCE[geometry, plane]))
    assert errors.max() <= LADDERS[order][1], errors


@pytest.mark.parametrize("order", LADDERS)
@CELLS
def test_rate_of_convergence(geometry, plane, order):
    """|L^ef(h) - L^ef| = O(h^2p) for elements of order p."""
    expected = cubic(*REFERENCE[geometry, plane])
    errors = [relative_error(L, expected) for L in ladder(geometry, plane, order)[-3:]]
    rate = -np.polyfit(np.arange(3), np.log2(errors), 1)[0]
    assert LADDERS[order][2] < rate < 2 * order + 0.5, (rate, errors)


@pytest.mark.parametrize("order", LADDERS)
def test_hexagonal_cell_is_transversely_isotropic(order):
    L = ladder("hexagonal", "strain", order)[-1]
    assert abs(L[2, 2] - (L[0, 0] - L[0, 1]) / 2) < LADDERS[order][1] * L[2, 2]
    assert abs(L[0, 0] - L[1, 1]) < LADDERS[order][1] * L[0, 0]


@pytest.mark.parametrize("young", [200.0, 1e-4], ids=["stiff", "nearly void"])
def test_dilute_slopes(comm, young):
    """dk/dc = 1/(1/(k_f - k_m) + 1/(k_m + mu_m)), dmu/dc = 1/(1/(mu_f - mu_m) + zeta) at c = 0, plane strain."""
    fibre = {"young": young, "poisson": 0.222}
    (la, mu), (la_f, mu_f) = lame(MATRIX), lame(fibre)
    k, k_f = la + mu, la_f + mu_f
    zeta = (k + 2 * mu) / (2 * mu * (k + mu))
    expected = np.array([1 / (1 / (k_f - k) + 1 / (k + mu)), 1 / (1 / (mu_f - mu) + zeta)])
    slopes = []
    for c in (0.01, 0.005):
        case = make_case(geometry="square", fibre=fibre, fibre_fraction=c, mesh_size=0.1, order=2, refine=1)
        torn, L, _ = solve(case, comm)
        fraction = torn.areas()["fibre"] / torn.summary.area
        bulk, shear = (L[0, 0] + L[0, 1]) / 2, ((L[0, 0] - L[0, 1]) / 2 + L[2, 2]) / 2
        slopes.append((np.array([bulk, shear]) - [k, mu]) / fraction)
    extrapolated = 2 * slopes[1] - slopes[0]
    assert np.abs(extrapolated / expected - 1).max() < 2e-3, (extrapolated, expected)


STIFFNESSES = {
    "isotropic": [lame(m) for m in (MATRIX, FIBRE)],
    "anisotropic": [
        [[10.0, 3.0, 1.0], [3.0, 5.0, -0.5], [1.0, -0.5, 2.0]],
        [[40.0, 8.0, -4.0], [8.0, 90.0, 6.0], [-4.0, 6.0, 15.0]],
    ],
}


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("across", [0, 1])
@pytest.mark.parametrize("phases", STIFFNESSES)
def test_laminate_is_exact(comm, shared_path, phases, across, order):
    """Strips of a quarter fibre, normal to x1 or x2; with a the strains and stresses that act across them,

    L_aa = <L_aa^-1>^-1, L_ab = L_aa <L_aa^-1 L_ab>, L_bb = <L_bb - L_ba L_aa^-1 L_ab> + <L_ba L_aa^-1> L_ab.
    """
    if comm.rank == 0:
        grid(lambda x, y: 0.25 < (x, y)[across] < 0.5).write(shared_path / "strips.msh")
    comm.barrier()
    L = [np.array(s) for s in STIFFNESSES[phases]]
    materials = [{"stiffness": s.tolist()} for s in L]
    if phases == "isotropic":
        materials = [MATRIX, FIBRE]
        L = [cubic(la + 2 * mu, la, mu) for la, mu in STIFFNESSES[phases]]
    _, found, _ = solve(
        make_case(
            geometry="mesh", file="strips.msh", folder=shared_path, order=order,
            matrix=materials[0], fibre=materials[1],
        ),
        comm,
    )  # fmt: skip
    assert relative_error(found, laminate(L, [0.75, 0.25], across)) < 1e-10


def laminate(stiffnesses, fractions, across):
    a, b = [across, 2], [1 - across]

    def mean(function):
        return sum(c * function(L) for c, L in zip(fractions, stiffnesses, strict=True))

    def soft(L):
        return np.linalg.inv(L[np.ix_(a, a)])

    aa = np.linalg.inv(mean(soft))
    ab = aa @ mean(lambda L: soft(L) @ L[np.ix_(a, b)])
    bb = mean(lambda L: L[np.ix_(b, b)] - L[np.ix_(b, a)] @ soft(L) @ L[np.ix_(a, b)])
    bb = bb + mean(lambda L: L[np.ix_(b, a)] @ soft(L)) @ ab
    result = np.empty((3, 3))
    result[np.ix_(a, a)], result[np.ix_(a, b)], result[np.ix_(b, a)], result[np.ix_(b, b)] = aa, ab, ab.T, bb
    return result


@pytest.mark.parametrize("fraction", [0.1, 0.4, 0.75])
@pytest.mark.parametrize("geometry", ["square", "hexagonal"])
def test_within_hashin_shtrikman(comm, geometry, fraction):
    """k = k_m + c/(1/(k_f - k_m) + (1 - c)/(k_m + mu_m)), mu alike with zeta; upper bounds with phases swapped."""
    torn, L, _ = solve(make_case(geometry=geometry, fibre_fraction=fraction, order=2, refine=1), comm)
    c = torn.areas()["fibre"] / torn.summary.area

    def bound(matrix, fibre, c):
        (la, mu), (la_f, mu_f) = lame(matrix), lame(fibre)
        k, k_f = la + mu, la_f + mu_f
        zeta = (k + 2 * mu) / (2 * mu * (k + mu))
        return (
            k + c / (1 / (k_f - k) + (1 - c) / (k + mu)),
            mu + c / (1 / (mu_f - mu) + (1 - c) * zeta),
        )

    lower, upper = bound(MATRIX, FIBRE, c), bound(FIBRE, MATRIX, 1 - c)
    assert lower[0] < (L[0, 0] + L[0, 1]) / 2 < upper[0]
    if geometry == "hexagonal":
        assert lower[1] < L[2, 2] < upper[1]


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("geometry", ["square", "hexagonal"])
def test_users_mesh_gives_the_same(comm, geometry, order):
    case = make_case(geometry="mesh", file=f"{geometry}.msh", folder=MESHES, order=order, refine=2 // order)
    _, L, _ = solve(case, comm)
    assert entry_errors(L, cubic(*REFERENCE[geometry, "strain"])).max() < {1: 3e-4, 2: 1e-5}[order]


@pytest.mark.parametrize("cell", [{"order": 1, "refine": 2}, {"order": 2, "refine": 1}])
@pytest.mark.parametrize("geometry", ["square", "hexagonal"])
def test_bodies_cut_by_the_cell_change_nothing(comm, geometry, cell):
    L = [solve(make_case(geometry=geometry, bodies=bodies, **cell), comm)[1] for bodies in ("torus", "plane")]
    assert relative_error(*L) < 1e-9


@pytest.mark.parametrize("cell", [{"refine": 2}, {"order": 2}])
def test_square_fibre(comm, shared_path, cell):
    if comm.rank == 0:
        grid().write(shared_path / "square_fibre.msh")
    comm.barrier()
    torn, L, _ = solve(make_case(geometry="mesh", file="square_fibre.msh", folder=shared_path, **cell), comm)
    assert torn.areas()["fibre"] == pytest.approx(0.25)
    assert relative_error(L, twin_stiffness(torn)) < 1e-9


@pytest.mark.parametrize("refine", range(3))
@pytest.mark.parametrize("order", [1, 2])
def test_iterations_do_not_grow(comm, order, refine):
    """Hexagonal cell, bodies on the torus, from 5 000 to 80 000 degrees of freedom."""
    case = make_case(mesh_size=0.062, order=order, refine=refine + 2 - order, decomposition={"subdomains": 1})
    torn, _, responses = solve(case, comm)
    assert torn.summary.subdomains == 3
    assert torn.sum_over_ranks(len(torn.solver.Q)) == pytest.approx(5_000 * 4**refine, rel=0.2)
    assert max(r.state.iterations for r in responses) <= 14
