"""The change of the elements' energy with the places of their nodes against differences of the energy."""

import numpy as np
import pytest
from reference import monolithic

from feti_homog.fem import AXIAL as AXIAL_SHEAR
from feti_homog.fem import PLANE
from feti_homog.fem.shape_functions import ElementFields, gradients

L = np.array([[9.0, 2.0, 1.0], [2.0, 8.0, 0.5], [1.0, 0.5, 3.0]])
ISOTROPIC = np.array([[9.0, 7.0, 0.0], [7.0, 9.0, 0.0], [0.0, 0.0, 1.0]])
# Of plane strains with two uniform loads, and of axial shear.
LOADED = np.array([[9.0, 2.0, 1.0, 3.0, -4.0], [2.0, 8.0, 0.5, 2.0, -3.0], [1.0, 0.5, 3.0, 0.4, -0.2],
                   [3.0, 2.0, 0.4, 7.0, -5.0], [-4.0, -3.0, -0.2, -5.0, 6.0]])  # fmt: skip
AXIAL = np.array([[2.0, 0.3], [0.3, 1.0]])
NONE = np.zeros(0)
CORNERS = np.array([[0.0, 0.0], [1.0, 0.1], [0.2, 0.9]])


def energy_change(points, u, A, uniform, moved, changed, is_mixed=False):
    """Return dW/ds under one load from the element fields."""
    problem = PLANE if u.shape[2] == 2 else AXIAL_SHEAR
    fields = ElementFields.of(problem, points, u[..., None], A, np.zeros((problem.strains, 1)), is_mixed)
    return fields.change(A, uniform[:, None], moved, changed[..., None]).item() / 2


def energy(points, u, is_mixed=False):
    """int W over the elements."""
    if is_mixed:
        each = zip(points, u.reshape(len(u), -1), strict=True)
        return sum(own @ monolithic.mixed_stiffness(corners, ISOTROPIC) @ own for corners, own in each) / 2
    g, w = gradients(points)
    grad = np.einsum("eai,eqad->eqid", u, g)
    strain = np.stack([grad[..., 0, 0], grad[..., 1, 1], grad[..., 0, 1] + grad[..., 1, 0]], axis=-1)
    return (w * np.einsum("eqi,ij,eqj->eq", strain, L, strain)).sum() / 2


def energy_of_all_loads(points, u, A, uniform):
    """int W over the elements, from the loads at every point."""
    g, w = gradients(points)
    grad = np.einsum("eai,eqad->eqid", u, g)
    strain = [grad[..., 0, 0], grad[..., 0, 1]]
    if u.shape[2] == 2:
        strain = [grad[..., 0, 0], grad[..., 1, 1], grad[..., 0, 1] + grad[..., 1, 0]]
    loads = np.stack([*strain, *(np.full(w.shape, load) for load in uniform)], axis=-1)
    return (w * np.einsum("eqi,ij,eqj->eq", loads, A, loads)).sum() / 2


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
    found = energy_change(points, u, ISOTROPIC if is_mixed else L, NONE, moved, changed, is_mixed)
    assert found == pytest.approx((ahead - behind) / (2 * s), rel=1e-6)


@pytest.mark.parametrize("order", [1, 2])
def test_a_shift_changes_nothing(order):
    points, u = elements(order, np.random.default_rng(3))
    shift = np.broadcast_to([0.3, -0.7], points.shape)
    assert abs(energy_change(points, u, L, NONE, shift, 2 * shift)) < 1e-12 * energy(points, u)


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize(("A", "uniform"), [(LOADED, np.array([0.7, -1.3])), (AXIAL, NONE)], ids=["loaded", "axial"])
def test_so_it_is_under_uniform_loads_and_in_axial_shear(order, A, uniform):
    rng = np.random.default_rng(order)
    points, u = elements(order, rng)
    u = u[..., : len(A) // 2]
    moved, changed, s = rng.standard_normal(points.shape), rng.standard_normal(u.shape), 1e-5
    ahead, behind = (energy_of_all_loads(points + t * moved, u + t * changed, A, uniform) for t in (s, -s))
    found = energy_change(points, u, A, uniform, moved, changed)
    assert found == pytest.approx((ahead - behind) / (2 * s), rel=1e-6)


def test_uniform_loads_change_mixed_elements_as_they_change_others():
    """Under a nearly constant pressure both kinds of triangle have equal energies of the loads."""
    rng = np.random.default_rng(7)
    points, u = elements(2, rng)
    points[:, 3:] = (points[:, :3] + np.roll(points[:, :3], -1, axis=1)) / 2
    moved, changed = rng.standard_normal((2, *points.shape))
    A, uniform = LOADED.copy(), np.array([0.7, -1.3])
    A[:3, :3] = ISOTROPIC
    A[:3, 3:] *= [[1.0], [1.0], [0.0]]
    A[3:, :3] = A[:3, 3:].T
    mixed, plain = (
        energy_change(points, u, A, uniform, moved, changed, is_mixed)
        - energy_change(points, u, ISOTROPIC, NONE, moved, changed, is_mixed)
        for is_mixed in (True, False)
    )
    assert mixed == pytest.approx(plain, rel=1e-9)
