"""Plane stiffness against closed forms and the three-dimensional law."""

import numpy as np
import pytest

from feti_homog.materials.laws import out_of_plane, plane_stiffness
from feti_homog.materials.material_forms import General, Isotropic, Orthotropic
from feti_homog.materials.voigt import rotated

CONSTANTS = {"E1": 140.0, "E2": 10.0, "E3": 12.0, "nu12": 0.3, "nu13": 0.25, "nu23": 0.4, "G12": 5.0}


def three_dimensional_stiffness(E1, E2, E3, nu12, nu13, nu23, G12):
    """(6, 6) in the order 11, 22, 33, 23, 13, 12; the two other shear moduli do not matter here."""
    compliance = np.diag([1 / E1, 1 / E2, 1 / E3, 1.0, 1.0, 1 / G12])
    compliance[0, 1] = compliance[1, 0] = -nu12 / E1
    compliance[0, 2] = compliance[2, 0] = -nu13 / E1
    compliance[1, 2] = compliance[2, 1] = -nu23 / E2
    return np.linalg.inv(compliance)


def tensor(stiffness):
    """Return the (2, 2, 2, 2) tensor of a (3, 3) stiffness."""
    place = {(0, 0): 0, (1, 1): 1, (0, 1): 2, (1, 0): 2}
    return np.array(
        [[[[stiffness[place[i, j], place[k, m]] for m in (0, 1)] for k in (0, 1)] for j in (0, 1)] for i in (0, 1)]
    )


def test_isotropic_plane_strain_is_lames_law():
    young, poisson = 88.0, 0.299
    lame = young * poisson / ((1 + poisson) * (1 - 2 * poisson))
    shear = young / (2 * (1 + poisson))
    expected = [[lame + 2 * shear, lame, 0], [lame, lame + 2 * shear, 0], [0, 0, shear]]
    np.testing.assert_allclose(plane_stiffness(Isotropic(young, poisson), "strain"), expected, rtol=1e-13)


def test_isotropic_plane_stress_is_hookes_law():
    young, poisson = 88.0, 0.299
    expected = np.array([[1, poisson, 0], [poisson, 1, 0], [0, 0, (1 - poisson) / 2]]) * young / (1 - poisson**2)
    np.testing.assert_allclose(plane_stiffness(Isotropic(young, poisson), "stress"), expected, rtol=1e-13)


@pytest.mark.parametrize("plane", ["strain", "stress"])
def test_orthotropic_with_isotropic_constants_is_isotropic(plane):
    young, poisson = 200.0, 0.222
    constants = {name: young for name in ("E1", "E2", "E3")} | {name: poisson for name in ("nu12", "nu13", "nu23")}
    material = Orthotropic(**constants, G12=young / (2 * (1 + poisson)), angle=37.0)
    expected = plane_stiffness(Isotropic(young, poisson), plane)
    np.testing.assert_allclose(plane_stiffness(material, plane), expected, rtol=1e-12, atol=1e-12 * young)


def test_orthotropic_plane_laws_follow_from_the_three_dimensional_one():
    whole = three_dimensional_stiffness(**CONSTANTS)
    expected = whole[np.ix_([0, 1, 5], [0, 1, 5])]
    np.testing.assert_allclose(plane_stiffness(Orthotropic(**CONSTANTS), "strain"), expected, rtol=1e-12, atol=1e-12)
    whole = three_dimensional_stiffness(**CONSTANTS)
    out = whole[[0, 1, 5], 2]
    expected = whole[np.ix_([0, 1, 5], [0, 1, 5])] - np.outer(out, out) / whole[2, 2]
    np.testing.assert_allclose(plane_stiffness(Orthotropic(**CONSTANTS), "stress"), expected, rtol=1e-12, atol=1e-12)


def test_axis_one_is_turned_towards_x2():
    turned = plane_stiffness(Orthotropic(**CONSTANTS, angle=90.0), "stress")
    straight = plane_stiffness(Orthotropic(**CONSTANTS), "stress")
    np.testing.assert_allclose(turned, straight[np.ix_([1, 0, 2], [1, 0, 2])], atol=1e-10)
    # stiff axis between x1 and x2: stretching along x1 needs positive shear stress to keep its direction
    assert plane_stiffness(Orthotropic(**CONSTANTS, angle=30.0), "stress")[0, 2] > 0.0


@pytest.mark.parametrize("angle", [0.0, 30.0, -75.0, 123.0])
def test_rotation_is_that_of_the_tensor(angle):
    stiffness = np.array([[5.0, 2.0, 0.3], [2.0, 4.0, -0.4], [0.3, -0.4, 1.5]])
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    axes = np.array([[c, -s], [s, c]])  # columns: the material axes in x1, x2
    expected = np.einsum("ip,jq,kr,ls,pqrs->ijkl", axes, axes, axes, axes, tensor(stiffness))
    np.testing.assert_allclose(tensor(rotated(stiffness, angle)), expected, atol=1e-12)


def test_a_general_stiffness_is_taken_as_it_is():
    rows = ((5.0, 2.0, 0.3), (2.0, 4.0, -0.4), (0.3, -0.4, 1.5))
    for plane in ("strain", "stress"):
        np.testing.assert_array_equal(plane_stiffness(General(rows), plane), rows)


@pytest.mark.parametrize(
    ("material", "words"),
    [
        (Isotropic(1.0, 0.5), "poisson = 0.5"),
        (Orthotropic(**(CONSTANTS | {"nu12": 4.0})), "nu12 = 4.0"),
        (Orthotropic(**(CONSTANTS | {"nu23": 0.95})), "positive definite compliance"),
        (Orthotropic(E1=1.0, E2=1.0, nu12=0.3, G12=0.4, E3=1.0), "nu13, nu23: missing"),
        (General(((1.0, 2.0, 0.0), (2.0, 1.0, 0.0), (0.0, 0.0, 1.0))), "positive definite"),
        (General(((3.0, 1.0, 0.0), (1.1, 3.0, 0.0), (0.0, 0.0, 1.0))), "symmetric"),
    ],
)
def test_unstable_materials_are_refused(material, words):
    with pytest.raises(ValueError, match=words):
        plane_stiffness(material, "strain")


def test_near_incompressible_is_stable():
    stiffness = plane_stiffness(Isotropic(1.0, 0.4999999), "strain")
    assert np.linalg.eigvalsh(stiffness).min() > 0.0


def in_space(material, plane, strain):
    """Return the stress (3, 3) and strain (3, 3) of the plane state with these strains [11, 22, 12] in space.

    They are turned back.
    """
    whole = three_dimensional_stiffness(**CONSTANTS)
    c, s = np.cos(np.radians(material.angle)), np.sin(np.radians(material.angle))
    turn = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])  # to the axes of the material
    E = np.array([[strain[0], strain[2] / 2, 0.0], [strain[2] / 2, strain[1], 0.0], [0.0, 0.0, 0.0]])
    own = turn @ E @ turn.T
    voigt = np.array([own[0, 0], own[1, 1], 0.0, 0.0, 0.0, 2 * own[0, 1]])
    if plane == "stress":
        voigt[2] = -whole[2] @ voigt / whole[2, 2]
    S = whole @ voigt
    stress = np.array([[S[0], S[5], 0.0], [S[5], S[1], 0.0], [0.0, 0.0, S[2]]])
    return turn.T @ stress @ turn, voigt[2]


@pytest.mark.parametrize("plane", ["strain", "stress"])
@pytest.mark.parametrize("angle", [0.0, 33.0])
def test_what_is_out_of_the_plane_is_that_of_the_three_dimensional_law(plane, angle):
    material, strain = Orthotropic(**CONSTANTS, angle=angle), np.array([0.3, -0.2, 0.5])
    stress = plane_stiffness(material, plane) @ strain
    expected, E33 = in_space(material, plane, strain)
    np.testing.assert_allclose(stress, expected[[0, 1, 0], [0, 1, 1]], rtol=1e-12)
    to_S33, to_E33 = out_of_plane(material, plane)
    np.testing.assert_allclose([to_S33 @ stress, to_E33 @ stress], [expected[2, 2], E33], rtol=1e-12, atol=1e-14)


def test_isotropic_phases_out_of_the_plane():
    stress = np.array([3.0, 1.0, 7.0])
    to_S33, to_E33 = out_of_plane(Isotropic(88.0, 0.25), "strain")
    assert to_S33 @ stress == pytest.approx(0.25 * 4.0) and to_E33 @ stress == 0
    to_S33, to_E33 = out_of_plane(Isotropic(88.0, 0.25), "stress")
    assert to_E33 @ stress == pytest.approx(-0.25 / 88.0 * 4.0) and to_S33 @ stress == 0


@pytest.mark.parametrize("plane", ["strain", "stress"])
def test_a_general_stiffness_does_not_say_what_is_out_of_the_plane(plane):
    rows = out_of_plane(General(((3.0, 1.0, 0.0), (1.0, 3.0, 0.0), (0.0, 0.0, 1.0))), plane)
    assert [bool(np.isnan(row).all()) for row in rows] == [plane == "strain", plane == "stress"]
