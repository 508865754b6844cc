"""Estimates of round fibres, bonded and on springs, against boundary value problems, Eshelby's tensor and cells."""

import dataclasses
import math

import numpy as np
import pytest
from reference.coated_fibre import axial_shear, axisymmetric_stiffness, self_consistent_shear, shear_of_fibre
from reference.fibre_composites import (
    ALUMINIUM,
    BORON,
    CARBON,
    EPOXY,
    GLASS,
    SOFT_EPOXY,
    compliance,
    isotropic,
)
from reference.references import ELASTIC

from feti_homog.materials.engineering_constants import transversely_isotropic_stiffness
from feti_homog.materials.estimates import METHODS
from feti_homog.materials.phase_bounds import Fibres, Springs, equivalent_fibre

PAIRS = [(ALUMINIUM, BORON), (EPOXY, CARBON), (SOFT_EPOXY, GLASS), (GLASS, EPOXY)]
BONDS = {
    "bonded": None,
    "springs": Springs(30.0, 8.0, 12.0, 0.4),
    "slippery": Springs(1e6, 1e-3, 1e-3, 0.4),
    "equal": Springs(20.0, 20.0, 20.0, 0.1),
}
every_pair = pytest.mark.parametrize(("matrix", "fibre"), PAIRS)
every_bond = pytest.mark.parametrize("springs", BONDS.values(), ids=BONDS.keys())


def compliances(springs, radius):
    """Return the compliances of the springs of a fibre of another radius with the same stiffness times radius."""
    if springs is None:
        return 0.0, 0.0, 0.0
    return tuple(radius / (k * springs.radius) for k in (springs.normal, springs.tangential, springs.axial))


@every_pair
@every_bond
@pytest.mark.parametrize("c", [0.05, 0.4, 0.8])
def test_self_consistent_shear_has_the_energy_of_the_medium(matrix, fibre, springs, c):
    found = METHODS["self_consistent"](matrix, [Fibres(c, fibre, springs)])

    def medium(shear):
        return dataclasses.replace(matrix, G_transverse=shear, K_transverse=found.K_transverse)

    expected = self_consistent_shear(matrix, fibre, c, medium, compliances(springs, math.sqrt(c)))
    assert found.G_transverse == pytest.approx(expected, rel=1e-9)


@every_pair
@pytest.mark.parametrize("c", [0.01, 0.5, 0.99])
def test_self_consistent_shear_is_the_printed_quadratic(matrix, fibre, c):
    """A x^2 + 2 B x + C = 0 of x = m*/m (Christensen and Lo 1979), with 3 - 4 nu of plane strain as 1 + 2 m/k."""
    r, f, m = (
        fibre.G_transverse / matrix.G_transverse,
        *(1 + 2 * x.G_transverse / x.K_transverse for x in (fibre, matrix)),
    )
    common = 3 * c * (1 - c) ** 2 * (r - 1) * (r + f)
    first, second = m * r + (r - 1) * c + 1, (r * m - f) * c**3
    A = common + (r * m + f * m - second) * (c * m * (r - 1) - (r * m + 1))
    B = -common + first / 2 * ((m - 1) * (r + f) - 2 * second) + c / 2 * (m + 1) * (r - 1) * (r + f + second)
    C = common + first * (r + f + second)
    root = (-B - math.sqrt(B**2 - A * C)) / A
    found = METHODS["self_consistent"](matrix, [Fibres(c, fibre)]).G_transverse
    assert found == pytest.approx(root * matrix.G_transverse, rel=1e-10)


@every_pair
@every_bond
@pytest.mark.parametrize("c", [0.05, 0.4, 0.8])
def test_composite_cylinders_solve_the_axisymmetric_problem(matrix, fibre, springs, c):
    found = METHODS["composite_cylinders"](matrix, [Fibres(c, fibre, springs)])
    (k, across, pressure), (_, along, stress) = axisymmetric_stiffness(
        matrix, fibre, c, compliances(springs, math.sqrt(c))
    )
    area, length = np.linalg.solve([[k, across], [across, along]], [-pressure, -stress])
    assert found.K_transverse == pytest.approx(k, rel=1e-10)
    assert found.nu_axial == pytest.approx(across / (2 * k), rel=1e-10)
    assert found.E_axial == pytest.approx(along - across**2 / k, rel=1e-10)
    assert (found.expansion_axial, found.expansion_transverse) == pytest.approx((length, area / 2), rel=1e-8)


@every_pair
@every_bond
@pytest.mark.parametrize("c", [0.05, 0.4, 0.8])
def test_composite_cylinders_solve_the_problem_of_axial_shear(matrix, fibre, springs, c):
    found = METHODS["composite_cylinders"](matrix, [Fibres(c, fibre, springs)]).G_axial
    expected = axial_shear(matrix, fibre, c, compliances(springs, math.sqrt(c)))
    assert found == pytest.approx(expected, rel=1e-10)


@every_pair
@every_bond
def test_equivalent_fibre_has_the_mean_stress_and_strain_of_one_on_springs(matrix, fibre, springs):
    a = 0.4
    expected = shear_of_fibre(matrix, fibre, a, compliances(springs, a))
    found = equivalent_fibre(Fibres(0.5, fibre, springs), matrix)
    assert found.G_transverse == pytest.approx(expected, rel=1e-9)
    assert found.E_transverse == pytest.approx(2 * expected * (1 + found.nu_transverse), rel=1e-9)


def eshelby(nu):
    """(6, 6) of a circular cylinder along x3 in an isotropic matrix, engineering shears (Mura 1987)."""
    S, q = np.zeros((6, 6)), 8 * (1 - nu)
    S[0, 0] = S[1, 1] = (5 - 4 * nu) / q
    S[0, 1] = S[1, 0] = (4 * nu - 1) / q
    S[0, 2] = S[1, 2] = nu / (2 * (1 - nu))
    S[3, 3] = S[4, 4] = 0.5
    S[5, 5] = 2 * (3 - 4 * nu) / q
    return S


def test_mori_tanaka_is_that_of_eshelbys_tensor_for_two_kinds_of_fibres():
    fractions, fibres = [0.3, 0.25], [CARBON, GLASS]
    Cm, am = transversely_isotropic_stiffness(EPOXY), np.array([54.0, 54.0, 54.0, 0, 0, 0])
    S = eshelby(EPOXY.nu_axial)
    concentrations = [np.eye(6)]
    stiffnesses, expansions, c = [Cm], [am], [0.45, *fractions]
    for fibre in fibres:
        C = transversely_isotropic_stiffness(fibre)
        concentrations.append(np.linalg.inv(np.eye(6) + S @ np.linalg.solve(Cm, C - Cm)))
        stiffnesses.append(C)
        expansions.append(np.array([fibre.expansion_transverse] * 2 + [fibre.expansion_axial, 0, 0, 0]))
    mean = np.linalg.inv(sum(x * A for x, A in zip(c, concentrations, strict=True)))
    parts = [C @ A @ mean for C, A in zip(stiffnesses, concentrations, strict=True)]
    total = sum(x * part for x, part in zip(c, parts, strict=True))
    # Levin's formula: stress concentrations B = C A (mean stiffness)^-1, alpha = sum c B^T alpha
    strain = sum(x * (part @ np.linalg.inv(total)).T @ a for x, part, a in zip(c, parts, expansions, strict=True))
    found = METHODS["mori_tanaka"](EPOXY, [Fibres(x, fibre) for x, fibre in zip(fractions, fibres, strict=True)])
    S = compliance(found.E_axial, found.E_transverse, found.nu_axial, found.nu_transverse, found.G_axial)
    np.testing.assert_allclose(np.linalg.inv(S), total, rtol=1e-11, atol=1e-12)
    assert (found.expansion_axial, found.expansion_transverse) == pytest.approx((strain[2], strain[0]), rel=1e-11)


@pytest.mark.parametrize(("normal", "tangential", "error"), [(1000, 1000, 1e-3), (1000, 250, 1e-3), (10, 2.5, 0.15)])
def test_hexagonal_cells_with_elastic_interfaces(normal, tangential, error):
    """Near the estimate, in shear across soft interfaces as near as a cell of holes is."""
    C11, C12, C33 = ELASTIC["hexagonal", normal, tangential].value
    radius = math.sqrt(0.4 * math.sqrt(3) / (2 * math.pi))  # of a cell of width 1
    springs = Springs(normal, tangential, tangential, radius)
    found = METHODS["self_consistent"](isotropic(88.0, 0.299), [Fibres(0.4, isotropic(200.0, 0.222), springs)])
    assert found.K_transverse == pytest.approx((C11 + C12) / 2, rel=1e-3)
    assert found.G_transverse == pytest.approx(C33, rel=error)
