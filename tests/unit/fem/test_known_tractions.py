"""Stresses that obey known tractions."""

import numpy as np
import pytest

from feti_homog.fem.local_fits import KnownTractions
from feti_homog.fem.problem import AXIAL, PLANE


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
