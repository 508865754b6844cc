"""Moduli and bounds against published numbers, closed forms and random tests."""

import dataclasses

import numpy as np
import pytest
from reference.references import HASHIN_SHTRIKMAN_BULK, HASHIN_SHTRIKMAN_SHEAR, REUSS_MODULI, VOIGT_MODULI

from feti_homog.materials.engineering_constants import (
    anisotropy,
    engineering_moduli,
    isotropic_part,
    isotropic_stiffness,
)
from feti_homog.materials.laws import plane_stiffness
from feti_homog.materials.material_forms import Isotropic, Orthotropic
from feti_homog.materials.phase_bounds import hashin_shtrikman, reuss, voigt
from feti_homog.materials.voigt import rotated

MATRIX = plane_stiffness(Isotropic(88.0, 0.299), "strain")
FIBRE = plane_stiffness(Isotropic(200.0, 0.222), "strain")
HALVES = ([0.6, 0.4], [MATRIX, FIBRE])


def test_bounds_are_those_of_the_reference_composite():
    np.testing.assert_allclose(isotropic_part(voigt(*HALVES)), VOIGT_MODULI.value, atol=VOIGT_MODULI.error)
    np.testing.assert_allclose(isotropic_part(reuss(*HALVES)), REUSS_MODULI.value, atol=REUSS_MODULI.error)
    bounds = hashin_shtrikman(*HALVES)
    np.testing.assert_allclose(bounds.bulk, HASHIN_SHTRIKMAN_BULK.value, atol=HASHIN_SHTRIKMAN_BULK.error)
    np.testing.assert_allclose(bounds.shear, HASHIN_SHTRIKMAN_SHEAR.value, atol=HASHIN_SHTRIKMAN_SHEAR.error)


@pytest.mark.parametrize("c", [0.05, 0.3, 0.8])
def test_lower_hashin_shtrikman_bound_is_the_two_phase_formula(c):
    (km, mm), (kf, mf) = isotropic_part(MATRIX), isotropic_part(FIBRE)
    zeta = (km + 2 * mm) / (2 * mm * (km + mm))
    bounds = hashin_shtrikman([1 - c, c], [MATRIX, FIBRE])
    assert bounds.bulk[0] == pytest.approx(km + c / (1 / (kf - km) + (1 - c) / (km + mm)), rel=1e-12)
    assert bounds.shear[0] == pytest.approx(mm + c / (1 / (mf - mm) + (1 - c) * zeta), rel=1e-12)


def test_bounds_are_nested_for_three_phases():
    soft = isotropic_stiffness(2.0, 1.0)
    fractions, phases = [0.2, 0.5, 0.3], [soft, MATRIX, FIBRE]
    bounds = hashin_shtrikman(fractions, phases)
    low, high = isotropic_part(reuss(fractions, phases)), isotropic_part(voigt(fractions, phases))
    assert low[0] < bounds.bulk[0] < bounds.bulk[1] < high[0]
    assert low[1] < bounds.shear[0] < bounds.shear[1] < high[1]


def test_bounds_meet_hill_where_shear_moduli_are_equal():
    shear, bulks, fractions = 3.0, np.array([4.0, 9.0]), np.array([0.7, 0.3])
    bounds = hashin_shtrikman(fractions, [isotropic_stiffness(bulk, shear) for bulk in bulks])
    exact = 1 / np.sum(fractions / (bulks + shear)) - shear
    np.testing.assert_allclose(bounds.bulk, exact, rtol=1e-13)
    np.testing.assert_allclose(bounds.shear, shear, rtol=1e-13)


def test_one_phase_is_its_own_bound():
    np.testing.assert_allclose(voigt([0.3, 0.7], [MATRIX, MATRIX]), MATRIX, rtol=1e-13)
    np.testing.assert_allclose(reuss([0.3, 0.7], [MATRIX, MATRIX]), MATRIX, rtol=1e-13, atol=1e-12)


def test_hashin_shtrikman_needs_isotropic_phases():
    with pytest.raises(ValueError, match="isotropic"):
        hashin_shtrikman([0.5, 0.5], [MATRIX, np.diag([3.0, 2.0, 1.0])])


def test_moduli_of_an_orthotropic_material_are_its_constants():
    constants = {"E1": 140.0, "E2": 10.0, "nu12": 0.3, "G12": 5.0}
    moduli = dataclasses.asdict(engineering_moduli(plane_stiffness(Orthotropic(**constants), "stress")))
    for name, value in constants.items():
        assert moduli[name] == pytest.approx(value, rel=1e-12)
    assert moduli["nu21"] == pytest.approx(0.3 * 10.0 / 140.0, rel=1e-12)
    assert moduli["eta1"] == pytest.approx(0.0, abs=1e-14)
    assert moduli["anisotropy"] > 0.5


def test_off_axis_modulus_and_mutual_influence_are_those_of_jones():
    E1, E2, nu12, G12, angle = 140.0, 10.0, 0.3, 5.0, np.radians(25.0)
    moduli = engineering_moduli(plane_stiffness(Orthotropic(E1=E1, E2=E2, nu12=nu12, G12=G12, angle=25.0), "stress"))
    c, s = np.cos(angle), np.sin(angle)
    compliance = c**4 / E1 + (1 / G12 - 2 * nu12 / E1) * s**2 * c**2 + s**4 / E2
    assert pytest.approx(1 / compliance, rel=1e-12) == moduli.E1
    # Jones, Mechanics of Composite Materials, (2.95): S16 of the rotated compliance
    coupling = (2 / E1 + 2 * nu12 / E1 - 1 / G12) * s * c**3 - (2 / E2 + 2 * nu12 / E1 - 1 / G12) * s**3 * c
    assert moduli.eta1 == pytest.approx(coupling / compliance, rel=1e-11)


def test_moduli_in_plane_stress_are_the_materials():
    moduli = engineering_moduli(plane_stiffness(Isotropic(88.0, 0.299), "stress"))
    assert (moduli.E1, moduli.nu12, moduli.G12) == pytest.approx((88.0, 0.299, 88.0 / 2.598), rel=1e-12)
    assert moduli.anisotropy < 1e-14


def test_invariants_are_the_same_in_all_axes():
    stiffness = np.array([[5.0, 2.0, 0.3], [2.0, 4.0, -0.4], [0.3, -0.4, 1.5]])
    for angle in (10.0, 45.0, 200.0):
        assert isotropic_part(rotated(stiffness, angle)) == pytest.approx(isotropic_part(stiffness), rel=1e-12)
        assert anisotropy(rotated(stiffness, angle)) == pytest.approx(anisotropy(stiffness), rel=1e-12)


@pytest.mark.parametrize("below", [2.0, 2.1], ids=["symmetric", "not symmetric"])
def test_isotropic_part_is_the_mean_over_all_axes(below):
    stiffness = np.array([[5.0, 2.0, 0.3], [below, 4.0, -0.4], [0.3, -0.4, 1.5]])
    mean = np.mean([rotated(stiffness, angle) for angle in np.arange(0.0, 360.0, 30.0)], axis=0)
    np.testing.assert_allclose((mean + mean.T) / 2, isotropic_stiffness(*isotropic_part(stiffness)), atol=1e-12)
