"""Voigt's notation: shears, names of loads, principal and equivalent stresses against those of the tensor."""

import numpy as np

from feti_homog.fem.problem import AXIAL, GENERALIZED, PLANE
from feti_homog.homogenization.phase_laws import AXIAL_SHEAR, IN_PLANE
from feti_homog.materials import voigt
from feti_homog.materials.voigt import SPATIAL_STRAINS, STRAINS


def test_names_are_those_of_the_unit_loads():
    assert PLANE.loads == STRAINS
    assert GENERALIZED.loads[: GENERALIZED.stresses] == tuple(SPATIAL_STRAINS[place] for place in IN_PLANE)
    assert AXIAL.loads == tuple(SPATIAL_STRAINS[place] for place in AXIAL_SHEAR)
    assert sorted(IN_PLANE + AXIAL_SHEAR) == list(range(6))


def tensors(stress, out_of_plane):
    whole = np.zeros((len(stress), 3, 3))
    whole[:, 0, 0], whole[:, 1, 1], whole[:, 2, 2] = stress[:, 0], stress[:, 1], out_of_plane
    whole[:, 0, 1] = whole[:, 1, 0] = stress[:, 2]
    return whole


def random(seed):
    rng = np.random.default_rng(seed)
    return rng.normal(size=(50, 3)), rng.normal(size=50)


def test_principal_stresses_are_the_eigenvalues_largest_first():
    stress, out_of_plane = random(1)
    expected = np.linalg.eigvalsh(tensors(stress, out_of_plane))[:, ::-1]
    np.testing.assert_allclose(voigt.principal(stress, out_of_plane), expected, atol=1e-14)


def test_von_mises_is_the_norm_of_the_deviator():
    stress, out_of_plane = random(2)
    whole = tensors(stress, out_of_plane)
    deviator = whole - np.trace(whole, axis1=1, axis2=2)[:, None, None] / 3 * np.eye(3)
    expected = np.sqrt(1.5 * (deviator**2).sum(axis=(1, 2)))
    np.testing.assert_allclose(voigt.von_mises(stress, out_of_plane), expected, rtol=1e-14)


def test_all_six_components_are_taken():
    stress, out_of_plane = random(3)
    axial = np.random.default_rng(4).normal(size=(50, 2))
    whole = tensors(stress, out_of_plane)
    whole[:, 1, 2] = whole[:, 2, 1] = axial[:, 0]
    whole[:, 0, 2] = whole[:, 2, 0] = axial[:, 1]
    principal = np.linalg.eigvalsh(whole)[:, ::-1]
    np.testing.assert_allclose(voigt.spatial_principal(stress, out_of_plane, axial), principal, atol=1e-14)
    shears = ((principal - np.roll(principal, 1, axis=1)) ** 2).sum(axis=1)
    mises = voigt.spatial_von_mises(stress, out_of_plane, axial)
    np.testing.assert_allclose(mises, np.sqrt(shears / 2), rtol=1e-13)


def test_of_tension_it_is_the_tension_however_large():
    stress = np.array([[1e300, 0.0, 0.0], [0.0, 1e-300, 0.0]])
    np.testing.assert_allclose(voigt.von_mises(stress, np.zeros(2)), [1e300, 1e-300], rtol=1e-14)


def test_what_is_not_known_out_of_the_plane_is_not_a_number():
    stress = np.array([[1.0, 2.0, 3.0]])
    assert np.isnan(voigt.von_mises(stress, np.array([np.nan]))).all()
    assert np.isnan(voigt.principal(stress, np.array([np.nan]))).all()
