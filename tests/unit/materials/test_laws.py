"""Plane stiffness against closed forms and the three-dimensional law."""

import numpy as np
import pytest

from feti_homog.materials.laws import out_of_plane, plane_stiffness
from feti_homog.materials.material_forms import General, Isotropic, Orthotropic

CONSTANTS = {"E1": 140.0, "E2": 10.0, "E3": 12.0, "nu12": 0.3, "nu13": 0.25, "nu23": 0.4, "G12": 5.0}


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
        (General(((1.0, 2.0, 0.0), (2.0, 1.0, 0.0), (0.0, 0.0, 1.0))), "positive definite"),
        (General(((3.0, 1.0, 0.0), (1.1, 3.0, 0.0), (0.0, 0.0, 1.0))), "symmetric"),
    ],
)
def test_unstable_materials_are_refused(material, words):
    with pytest.raises(ValueError, match=words):
        plane_stiffness(material, "strain")


@pytest.mark.parametrize("plane", ["strain", "stress"])
def test_a_general_stiffness_does_not_say_what_is_out_of_the_plane(plane):
    rows = out_of_plane(General(((3.0, 1.0, 0.0), (1.0, 3.0, 0.0), (0.0, 0.0, 1.0))), plane)
    assert [bool(np.isnan(row).all()) for row in rows] == [plane == "strain", plane == "stress"]
