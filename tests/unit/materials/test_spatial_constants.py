"""Constants of spatial stiffnesses against compliances, turned tensors and random tests."""

import dataclasses

import numpy as np
import pytest
from reference.fibre_composites import compliance
from support.effective_results import Sample, tensor_of_stiffness, turned_stiffness

from feti_homog.materials.engineering_constants import (
    EngineeringConstants,
    engineering_constants,
    is_transversely_isotropic,
    transverse_moduli,
    transversely_isotropic_part,
    transversely_isotropic_stiffness,
)

CONSTANTS = {"E1": 11.0, "E2": 14.0, "E3": 140.0, "nu12": 0.35, "nu13": 0.02, "nu23": 0.03, "G12": 4.0, "G13": 5.0}
CONSTANTS["G23"] = 6.0


def random_stiffness(seed):
    factor = np.random.default_rng(seed).standard_normal((6, 6))
    return factor @ factor.T + 0.1 * np.eye(6)


def turned(stiffness, degrees):
    """Return the same material turned about x3."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return turned_stiffness(stiffness, np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]))


def test_constants_of_an_orthotropic_stiffness_are_those_it_is_made_of():
    found = engineering_constants(np.linalg.inv(Sample(tuple(CONSTANTS.values()), None).compliance))
    assert dataclasses.asdict(found) == pytest.approx(CONSTANTS, rel=1e-12)
    assert isinstance(found, EngineeringConstants)


def test_contractions_are_those_of_a_state_of_uniaxial_stress():
    stiffness = random_stiffness(1)
    found = engineering_constants(stiffness)
    for i, E in enumerate((found.E1, found.E2, found.E3)):
        strain = np.linalg.solve(stiffness, np.eye(6)[i])
        assert 1 / strain[i] == pytest.approx(E, rel=1e-12)
        for j, nu in {0: ((1, found.nu12), (2, found.nu13)), 1: ((2, found.nu23),), 2: ()}[i]:
            assert -strain[j] / strain[i] == pytest.approx(nu, rel=1e-9)


def test_constants_of_a_transversely_isotropic_stiffness_are_those_it_is_made_of():
    found = transversely_isotropic_part(np.linalg.inv(compliance(235.0, 14.0, 0.2, 0.25, 28.0)), [9, 9, -0.9, 0, 0, 0])
    given = {
        "E_axial": 235.0, "E_transverse": 14.0, "nu_axial": 0.2, "nu_transverse": 0.25, "G_axial": 28.0,
        "G_transverse": 5.6, "expansion_axial": -0.9, "expansion_transverse": 9.0,
    }  # fmt: skip
    assert {name: getattr(found, name) for name in given} == pytest.approx(given, rel=1e-12)
    assert is_transversely_isotropic(found)
    # Stress that holds the axis and makes a unit change of area.
    assert found.K_transverse == pytest.approx(235 / (2 * (0.75 * 235 / 14 - 2 * 0.04)), rel=1e-12)


@pytest.mark.parametrize("asymmetry", [0.0, 0.1])
@pytest.mark.parametrize("seed", range(3))
def test_nearest_transversely_isotropic_stiffness_is_the_mean_over_all_turns(seed, asymmetry):
    stiffness = random_stiffness(seed)
    stiffness += asymmetry * np.random.default_rng(seed).standard_normal((6, 6))
    mean = np.mean([turned(stiffness, degrees) for degrees in np.arange(0.0, 360.0, 30.0)], axis=0)
    nearest = transversely_isotropic_stiffness(transversely_isotropic_part(stiffness))
    np.testing.assert_allclose(nearest, (mean + mean.T) / 2, atol=1e-13 * np.linalg.norm(stiffness))


@pytest.mark.parametrize("seed", range(3))
def test_deviation_is_the_distance_of_the_tensors(seed):
    stiffness = random_stiffness(seed)
    found = transversely_isotropic_part(stiffness)
    whole = tensor_of_stiffness(stiffness)
    rest = whole - tensor_of_stiffness(transversely_isotropic_stiffness(found))
    assert found.deviation == pytest.approx(np.linalg.norm(rest) / np.linalg.norm(whole), rel=1e-12)
    assert not is_transversely_isotropic(found)


def test_expansion_is_the_mean_over_all_turns():
    found = transversely_isotropic_part(np.eye(6), [3.0, 5.0, 7.0, 0.0, 0.0, 2.0])
    assert (found.expansion_axial, found.expansion_transverse) == (7.0, 4.0)
    without = transversely_isotropic_part(np.eye(6))
    assert (without.expansion_axial, without.expansion_transverse) == (None, None)


def test_singular_stiffness_has_no_constants():
    with pytest.raises(np.linalg.LinAlgError):
        engineering_constants(np.zeros((6, 6)))


@pytest.mark.parametrize("seed", range(5))
def test_transverse_moduli_are_those_in_turned_axes(seed):
    stiffness = random_stiffness(seed)
    constants = [engineering_constants(turned(stiffness, degrees)) for degrees in np.arange(0.0, 180.0, 0.25)]
    expected = {
        f"{name[0]}_{end}": choose([getattr(own, name) for own in constants])
        for name in ("E1", "G12") for end, choose in (("least", min), ("largest", max))
    }  # fmt: skip
    assert dataclasses.asdict(transverse_moduli(stiffness)) == pytest.approx(expected, rel=1e-10)
