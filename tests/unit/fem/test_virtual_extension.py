"""The change of the elements' energy with the places of their nodes against differences of the energy."""

import numpy as np
import pytest
from reference import monolithic

from feti_homog.fem.shape_functions import energy_change, gradients

L = np.array([[9.0, 2.0, 1.0], [2.0, 8.0, 0.5], [1.0, 0.5, 3.0]])
ISOTROPIC = np.array([[9.0, 7.0, 0.0], [7.0, 9.0, 0.0], [0.0, 0.0, 1.0]])
CORNERS = np.array([[0.0, 0.0], [1.0, 0.1], [0.2, 0.9]])


def energy(points, u, is_mixed=False):
    """int W over the elements."""
    if is_mixed:
        each = zip(points, u.reshape(len(u), -1), strict=True)
        return sum(own @ monolithic.mixed_stiffness(corners, ISOTROPIC) @ own for corners, own in each) / 2
    g, w = gradients(points)
    grad = np.einsum("eai,eqad->eqid", u, g)
    strain = np.stack([grad[..., 0, 0], grad[..., 1, 1], grad[..., 0, 1] + grad[..., 1, 0]], axis=-1)
    return (w * np.einsum("eqi,ij,eqj->eq", strain, L, strain)).sum() / 2


def elements(order, rng):
    """Three curved elements of random shape, and random displacements."""
    points = np.stack([CORNERS] * 3) + 0.1 * rng.standard_normal((3, 3, 2))
    if order == 2:
        points = np.concatenate([points, (points + np.roll(points, -1, axis=1)) / 2], axis=1)
        points[:, 3:] += 0.02 * rng.standard_normal((3, 3, 2))
    return points, rng.standard_normal(points.shape)


@pytest.mark.parametrize(("order", "is_mixed"), [(1, False), (2, False), (2, True)])
def test_it_is_the_derivative_of_the_energy(order, is_mixed):
    rng = np.random.default_rng(order)
    points, u = elements(order, rng)
    moved, changed = rng.standard_normal((2, *points.shape))
    s = 1e-5
    ahead, behind = (energy(points + t * moved, u + t * changed, is_mixed) for t in (s, -s))
    found = energy_change(points, u, ISOTROPIC if is_mixed else L, moved, changed, is_mixed)
    assert found == pytest.approx((ahead - behind) / (2 * s), rel=1e-6)


@pytest.mark.parametrize("order", [1, 2])
def test_a_shift_changes_nothing(order):
    points, u = elements(order, np.random.default_rng(3))
    shift = np.broadcast_to([0.3, -0.7], points.shape)
    assert abs(energy_change(points, u, L, shift, 2 * shift)) < 1e-12 * energy(points, u)
