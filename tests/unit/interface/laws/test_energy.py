"""Break by the energy of springs in closed form, and numbers along the fibres that a case does not give."""

import numpy as np
import pytest

from feti_homog.case.bond_laws import LAWS
from feti_homog.case.interface_section import InterfaceSection
from feti_homog.interface.laws import law_of_sections
from feti_homog.interface.laws.energy import SpringEnergy, released_energy

# Springs stiffer than any H of these tests.
STIFF = np.array([[9.0, 9.0]])


def criterion(mode_sensitivity=0.25):
    return SpringEnergy(2025.0, 506.25, 2.0, mode_sensitivity)


def test_modes_break_at_their_toughness():
    # sigma_c = sqrt(2 k_n G_Ic) = 90 in opening; in shear G_c = G_Ic [1 + tan^2((1 - lambda) 90 degrees)].
    shear = np.sqrt(2 * 506.25 * 2.0 * (1 + np.tan(np.radians(0.75 * 90)) ** 2))
    used = criterion().share(np.array([[90.0, 0.0], [0.0, shear], [0.0, -shear], [-50.0, shear], [-90.0, 0.0]]))
    assert used == pytest.approx([1.0, 1.0, 1.0, 1.0, 0.0])
    t_n, t_t = 40.0, 30.0
    first, second = t_n**2 / (2 * 2025.0), t_t**2 / (2 * 506.25)
    toughness = 2.0 * (1 + np.tan(0.75 * np.arctan(np.sqrt(second / first))) ** 2)
    assert criterion().share(np.array([[t_n, t_t]])) == pytest.approx(np.sqrt((first + second) / toughness))
    assert criterion(0.0).share(np.array([[0.0, 1e6]])) == pytest.approx(0.0, abs=1e-8)
    assert criterion(1.0).share(np.array([[0.0, 45.0]])) == pytest.approx(1.0)


@pytest.mark.parametrize("mode_sensitivity", [0.0, 0.25, 1.0])
def test_utilisation_is_homogeneous_and_convex(mode_sensitivity):
    law = criterion(mode_sensitivity).share
    a, b = np.random.default_rng(1).normal(size=(2, 2000, 2)) * 50
    assert law(3.0 * a) == pytest.approx(3.0 * law(a))
    for share in (0.2, 0.5, 0.9):
        assert (law(share * a + (1 - share) * b) <= share * law(a) + (1 - share) * law(b) + 1e-12).all()


def test_what_a_break_releases_is_continuous_where_its_faces_begin_to_overlap():
    H = np.array([[[2.0, 0.7], [0.7, 1.5]]])
    # The normal part of H^-1 lam vanishes for lam = (0.7, 1.5).
    at = np.array([[0.7, 1.5]])
    below, above = (released_energy(H, at + np.array([[e, 0.0]]), STIFF, True) for e in (-1e-9, 1e-9))
    assert below == pytest.approx(above, rel=1e-8) and above == pytest.approx(1.5**2 / 1.5 / 2)
    assert released_energy(H, np.array([[-5.0, 1.5]]), STIFF, True) == pytest.approx(1.5**2 / 1.5 / 2)
    assert released_energy(H, np.array([[3.0, 0.0]]), STIFF, True) == pytest.approx(9.0 * np.linalg.inv(H[0])[0, 0] / 2)


def test_breaks_release_both_parts_and_those_of_free_fibres_nothing():
    forces = np.array([[1e-12, -1e-12]])
    assert released_energy(np.zeros((1, 2, 2)), forces, STIFF, True) == 0.0
    rigid_across = np.array([[[1e-17, 0.0], [0.0, 2.0]]])
    assert released_energy(rigid_across, np.array([[1e-12, 3.0]]), STIFF, True) == pytest.approx(9.0 / 2.0 / 2)
    H, lam = np.array([[[2.0, 0.7], [0.7, 1.5]]]), np.array([[-5.0, 1.5]])
    expected = lam[0] @ np.linalg.solve(H[0], lam[0]) / 2
    assert released_energy(H, lam, STIFF, False) == pytest.approx(expected)


NUMBERS = {
    "normal_stiffness": 100.0, "tangential_stiffness": 50.0, "normal_strength": 2.0, "tangential_strength": 1.5,
    "normal_toughness": 0.5, "tangential_toughness": 0.7, "toughness": 0.5, "openings": (0.02, 0.5),
    "tractions": (2.0, 0.0), "teeth": 4,
}  # fmt: skip
AROUND, ALONG = np.array([[0.3, 0.7, 0.0]]), np.array([[0.3, 0.0, 0.7]])


def shares(law, **more):
    """Return the utilisation of a bond under the shear AROUND a fibre, and under the shear ALONG the fibre."""
    found = law_of_sections([InterfaceSection(criterion=law, **NUMBERS | more)], np.zeros(1, np.int64))
    return found.share(AROUND)[0], found.share(ALONG)[0]


@pytest.mark.parametrize("law", LAWS)
def test_shear_along_the_fibres_uses_what_it_uses_around_them(law):
    around, along = shares(law)
    assert along == pytest.approx(around, rel=1e-12)


@pytest.mark.parametrize("law", LAWS)
def test_numbers_along_the_fibres_are_their_own_where_they_are_given(law):
    """Four times the axial strength acts as a fourth of the shear; four times the stiffness, as half of the shear."""
    has_strength = "axial_strength" in LAWS[law].keys
    key, size = ("axial_strength", 6.0) if has_strength else ("axial_stiffness", 200.0)
    around, along = shares(law, **{key: size})
    assert around == pytest.approx(shares(law)[0])
    found = law_of_sections([InterfaceSection(criterion=law, **NUMBERS)], np.zeros(1, np.int64))
    fewer = np.array([[0.3, 0.0, 0.7 / (4.0 if has_strength else 2.0)]])
    assert along == pytest.approx(found.share(fewer)[0], rel=1e-12)
