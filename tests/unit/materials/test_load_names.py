"""The names of strains in case files and results against those of the problems that are solved."""

from feti_homog.fem.problem import AXIAL, GENERALIZED, PLANE
from feti_homog.homogenization.phase_laws import AXIAL_SHEAR, IN_PLANE
from feti_homog.materials.voigt import SPATIAL_STRAINS, STRAINS


def test_names_are_those_of_the_unit_loads():
    assert PLANE.loads == STRAINS
    assert GENERALIZED.loads[: GENERALIZED.stresses] == tuple(SPATIAL_STRAINS[place] for place in IN_PLANE)
    assert AXIAL.loads == tuple(SPATIAL_STRAINS[place] for place in AXIAL_SHEAR)
    assert sorted(IN_PLANE + AXIAL_SHEAR) == list(range(6))
