"""Recovered stresses against least squares about one vertex after the other, and those that obey known tractions."""

import numpy as np
import pytest
from scipy.spatial import Delaunay

from feti_homog.fem import local_fits
from feti_homog.fem.local_fits import NEIGHBOURS, KnownTractions
from feti_homog.fem.problem import AXIAL, PLANE
from feti_homog.fem.stress_recovery import LINEAR_AT_ONCE, RecoveredStress


def fit_at(points, triangles, stress, v):
    """Return the fit (m k,) at vertex v to the stresses (e, m k) around it, on the boundary also around neighbours."""
    corners = points[triangles]
    areas, middles = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / 2, corners.mean(axis=1)
    sides = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    edges, count = np.unique(sides, axis=0, return_counts=True)
    own = edges[(edges == v).any(axis=1)]
    groups = [(1.0, v)]
    if (count[(edges == v).any(axis=1)] == 1).any():
        groups += [(NEIGHBOURS[1], w) for w in own[own != v]]
    chosen = [(share * areas[e], e) for share, w in groups for e in np.flatnonzero((triangles == w).any(axis=1))]
    roots, at = np.sqrt([weight for weight, _ in chosen]), [e for _, e in chosen]
    basis = np.column_stack([np.ones(len(at)), middles[at] - points[v]])
    return np.linalg.lstsq(roots[:, None] * basis, roots[:, None] * stress[at], rcond=None)[0][0]


@pytest.mark.parametrize("problem", [PLANE, AXIAL], ids=["plane", "axial"])
def test_difference_is_that_of_fits_about_each_vertex(problem):
    rng = np.random.default_rng(3)
    points = rng.random((60, 2))
    triangles = Delaunay(points).simplices
    c, m, k = problem.components, problem.strains, 2
    u, loads, root = rng.random((len(points), c, k)), rng.random((m, k)), rng.random((m, m))
    L = root @ root.T + np.eye(m)
    body = RecoveredStress(points, triangles, np.arange(len(points)), L, problem, u, loads)
    sides = np.concatenate([np.ones((len(triangles), 3, 1)), points[triangles]], axis=2)
    gradient = np.einsum("edx,exck->ecdk", np.linalg.inv(sides)[:, 1:], u[triangles])
    strain = np.stack([gradient[:, problem.voigt == n].sum(axis=1) for n in range(m)], axis=1)
    stress = (L @ (strain + loads)).reshape(len(triangles), -1)
    at = np.stack([fit_at(points, triangles, stress, v) for v in range(len(points))])[triangles]
    off = ((at + np.roll(at, 1, axis=1)) / 2 - stress[:, None]).reshape(-1, 3, m, k)  # in the middles of the sides
    areas = np.abs(np.linalg.det(sides)) / 2
    expected = np.einsum("e,eqak,ab,eqbl->kl", areas / 3, off, np.linalg.inv(L), off)
    total, shares = body.difference()
    np.testing.assert_allclose(total, expected, rtol=1e-6)
    np.testing.assert_allclose(shares.sum(axis=0), np.diag(expected), rtol=1e-6)


def test_many_bodies_have_the_sum_of_their_differences():
    rng, copies = np.random.default_rng(4), 60
    points, u, loads = rng.random((60, 2)), rng.random((60, 2, 1)), rng.random((3, 1))
    triangles = Delaunay(points).simplices
    first = 60 * np.arange(copies)[:, None, None]
    assert copies * len(triangles) > LINEAR_AT_ONCE
    one, many = (
        RecoveredStress(
            np.tile(points, (k, 1)), (triangles + first[:k]).reshape(-1, 3), np.arange(60 * k), np.eye(3), PLANE,
            np.tile(u, (k, 1, 1)), loads,
        ).difference(np.ones(k * len(triangles)))
        for k in (1, copies)
    )  # fmt: skip
    np.testing.assert_allclose(many[0], copies * one[0], rtol=1e-12)
    np.testing.assert_allclose(many[1], np.tile(one[1], (copies, 1)), rtol=1e-9)


@pytest.mark.parametrize("problem", [PLANE, AXIAL])
def test_tractions_are_obeyed_and_strains_along_the_boundary_stay(problem):
    random = np.random.default_rng(1)
    m, c = problem.strains, problem.components
    stress, A = random.normal(size=(5, m, 3)), random.normal(size=(m, m))
    S, angle = A @ A.T + np.eye(m), random.uniform(0, 2 * np.pi, 3)
    # Of mean normals, those of vertices where sides meet at an angle are shorter than 1.
    node, normals = np.array([3, 1, 4]), np.column_stack([np.cos(angle), np.sin(angle)]) * [[1.0], [0.7], [0.9]]
    given = random.normal(size=(3, c, 3))
    known = KnownTractions.at(node, normals, given)
    found = known.imposed(stress, known.node, problem.voigt, S)
    np.testing.assert_array_equal(found[[0, 2]], stress[[0, 2]])
    for vertex, n, t in zip(known.node, known.normal, known.traction, strict=True):
        np.testing.assert_allclose(np.einsum("cdk,d->ck", found[vertex][problem.voigt], n), t, atol=1e-12)
        if c == 2:
            along = np.array([n[1] ** 2, n[0] ** 2, -n[0] * n[1]])
            np.testing.assert_allclose(along @ S @ (found - stress)[vertex], 0.0, atol=1e-12)


def test_a_vertex_at_which_normals_cancel_has_no_tractions():
    """Two fibres touch at vertex 2, from left and right of it; rounding would choose a normal."""
    normals = np.array([[0.0, 5e-18], [0.0, 1.0]])
    known = KnownTractions.at(np.array([2, 5]), normals, np.ones((2, 2, 1)))
    np.testing.assert_array_equal(known.node, [5])
    np.testing.assert_array_equal(known.normal, [[0.0, 1.0]])


@pytest.mark.parametrize("order", [1, 2])
def test_uniform_stresses_are_recovered_where_all_centres_lie_on_a_line_beside_a_vertex(order):
    """Such lines occur in layers one element wide; they determine no slope across."""
    away = np.array([[0.05, -0.1], [0.05, 0.02], [0.05, 0.1]])
    if order == 1:
        vertices, spread = np.array([[0, 0, 0], [1, 2, 3], [4, 5, 6]]), np.full((2, 3, 3), 0.07)
        spread[:, 0] = away.T
        none = local_fits.PatchNeighbours(np.zeros(0, int), np.zeros(0, int), np.zeros((0, 2)))
        found = local_fits.linear_values(vertices, spread, np.arange(1.0, 4.0), np.full((3, 1), 7.0), none)[:, 0]
    else:
        basis = local_fits.polynomials(away, 2)
        found = local_fits.fitted((basis.T @ basis)[None], 7.0 * basis.sum(axis=0)[None, :, None])[0, :1, 0]
    assert found == pytest.approx(7.0, rel=1e-6)
