"""Hexagonal cells of coated fibres in generalized plane strain against closed forms of three phases."""

import dataclasses
from functools import cache

import numpy as np
import pytest
from reference.fibre_composites import isotropic
from reference.layered_cylinder import (
    constants_of,
    dilute_axial_shear,
    dilute_bulk,
    dilute_shear,
    self_consistent_shear,
)
from reference.spatial_forms import axial_shear_modulus, layered_contrast
from support.spatial_cells import solved

from feti_homog.materials.engineering_constants import transversely_isotropic_part

pytestmark = [pytest.mark.parallel, pytest.mark.one_rank]

MATRIX, FIBRE = {"young": 3.0, "poisson": 0.35}, {"young": 70.0, "poisson": 0.22}
COATINGS = {"soft": {"young": 0.4, "poisson": 0.4}, "stiff": {"young": 25.0, "poisson": 0.3}}
every_coating = pytest.mark.parametrize("coating", COATINGS)
THICKNESS = 0.1
OUTER = (1 + THICKNESS) ** 2  # area of a coated fibre / that of the fibre


@pytest.fixture(scope="module")
def constants():
    """constants(coating, fraction, refine): those of the nearest transversely isotropic composite."""
    from mpi4py import MPI

    @cache
    def made(coating, fraction, refine=1):
        material = {"matrix": MATRIX, "fibre": FIBRE, "coating": COATINGS[coating]}
        cell = {"geometry": "hexagonal", "fibre_fraction": fraction, "coating": THICKNESS, "mesh_size": 0.1, "order": 2}
        result = solved(MPI.COMM_WORLD, **cell, refine=refine, sections={"material": material})
        return transversely_isotropic_part(result.effective_stiffness)

    return made


def isotropic_phase(material):
    return isotropic(material["young"], material["poisson"])


def cylinders(coating, fraction):
    """Fibre, coating and matrix, of the outer radius 1."""
    a = np.sqrt(fraction)
    phases = map(isotropic_phase, (FIBRE, COATINGS[coating], MATRIX))
    return list(zip(phases, (a, a * (1 + THICKNESS), 1.0), strict=True))


def periodic_axial_shear(coating, fraction):
    """Return the axial shear modulus by Rayleigh's series, the coated fibre in place of the homogeneous one."""
    fibre, ring, matrix = (layer.G_axial for layer, _ in cylinders(coating, fraction))
    contrast = layered_contrast(fibre / matrix, ring / matrix, 1 / OUTER)
    return matrix * axial_shear_modulus("hexagonal", fraction * OUTER, contrast)


@every_coating
def test_composite_cylinders(constants, coating):
    """K, E_A, nu_A and G_A (Hashin and Rosen 1964): of so few fibres the hexagonal cell differs by less than 1e-7."""
    found = constants(coating, 0.1)
    K, E, nu, G = constants_of(cylinders(coating, 0.1))
    assert (found.K_transverse, found.E_axial, found.nu_axial) == pytest.approx((K, E, nu), rel=1.5e-6)
    assert found.G_axial == pytest.approx(G, rel=4e-6)


@every_coating
@pytest.mark.parametrize("fraction", [0.1, 0.3])
def test_axial_shear_modulus_of_the_periodic_cell(constants, coating, fraction):
    assert constants(coating, fraction).G_axial == pytest.approx(periodic_axial_shear(coating, fraction), rel=8e-6)


@every_coating
def test_constants_converge_with_quadratic_elements(constants, coating):
    _, E, *_ = constants_of(cylinders(coating, 0.1))
    G = periodic_axial_shear(coating, 0.3)

    def errors(refine):
        few, many = constants(coating, 0.1, refine), constants(coating, 0.3, refine)
        return np.abs([few.E_axial / E - 1, many.G_axial / G - 1])

    assert (np.log2(errors(0) / errors(1)) > 3.4).all()


@every_coating
def test_transverse_shear_is_the_generalized_self_consistent_one(constants, coating):
    """Christensen and Lo's condition for three phases; periodic cells depart by a higher power of the fraction."""
    departures = []
    for fraction in (0.01, 0.1):
        layers = cylinders(coating, fraction)
        found, K = constants(coating, fraction).G_transverse, constants_of(layers)[0]

        def medium(shear, K=K):
            return dataclasses.replace(isotropic_phase(MATRIX), G_transverse=shear, K_transverse=K)

        departures.append(abs(found / self_consistent_shear(layers, medium) - 1))
    assert departures[0] < 1e-5 and departures[1] < 3e-3


@every_coating
def test_few_coated_fibres_stiffen_as_one_alone(constants, coating):
    """dK/dc, dG/dc and dG_A/dc at c = 0, extrapolated from two fractions, against a coated fibre in all the matrix."""
    matrix, layers = isotropic_phase(MATRIX), cylinders(coating, 0.01)[:2]
    names = ("K_transverse", "G_transverse", "G_axial")

    def slopes(fraction):
        found = constants(coating, fraction)
        return np.array([(getattr(found, name) - getattr(matrix, name)) / (fraction * OUTER) for name in names])

    expected = [slope(matrix, layers) for slope in (dilute_bulk, dilute_shear, dilute_axial_shear)]
    assert 2 * slopes(0.01) - slopes(0.02) == pytest.approx(expected, rel=1e-3)
