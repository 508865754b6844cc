"""The closed forms of coated fibres that cells are held against, where they are those of plain fibres."""

import dataclasses

import numpy as np
import pytest
from reference import coated_fibre
from reference.closed_forms import zeta
from reference.fibre_composites import BORON, CARBON, EPOXY, GLASS, fibre_like
from reference.layered_cylinder import (
    axisymmetric_stiffness,
    constants_of,
    dilute_axial_shear,
    dilute_bulk,
    dilute_shear,
    self_consistent_shear,
)
from reference.spatial_forms import axial_shear_modulus, layered_contrast

SOFT = fibre_like(0.3, 0.2, 0.3, 0.35, 0.1)
FIBRES = pytest.mark.parametrize("fibre", [GLASS, CARBON, BORON, SOFT])


def medium_of(shear):
    return dataclasses.replace(EPOXY, G_transverse=shear, K_transverse=12.0)


@FIBRES
@pytest.mark.parametrize("c", [0.05, 0.4, 0.8])
def test_layers_of_one_phase_are_one_layer(fibre, c):
    a, between = np.sqrt(c), np.sqrt(c) * 0.9
    plain = [(fibre, a), (EPOXY, 1.0)]
    for layers in (plain, [(fibre, between), (fibre, a), (EPOXY, 1.0)], [(fibre, a), (EPOXY, (1 + a) / 2), (EPOXY, 1)]):
        whole = axisymmetric_stiffness(layers)
        assert whole == pytest.approx(coated_fibre.axisymmetric_stiffness(EPOXY, fibre, c)[:, :2], rel=1e-11)
        assert whole == pytest.approx(whole.T, rel=1e-11)
        assert constants_of(layers)[3] == pytest.approx(coated_fibre.axial_shear(EPOXY, fibre, c), rel=1e-11)
        expected = coated_fibre.self_consistent_shear(EPOXY, fibre, c, medium_of)
        assert self_consistent_shear(layers, medium_of) == pytest.approx(expected, rel=1e-9)


@FIBRES
def test_slopes_of_plain_fibres_are_eshelbys(fibre):
    K, G = EPOXY.K_transverse, EPOXY.G_transverse
    layers = [(fibre, 0.3), (fibre, 0.4)]
    assert dilute_shear(EPOXY, layers) == pytest.approx(1 / (1 / (fibre.G_transverse - G) + zeta(K, G)), rel=1e-10)
    assert dilute_bulk(EPOXY, layers) == pytest.approx(1 / (1 / (fibre.K_transverse - K) + 1 / (K + G)), rel=1e-10)
    contrast = fibre.G_axial / EPOXY.G_axial
    assert dilute_axial_shear(EPOXY, layers) == pytest.approx(
        2 * EPOXY.G_axial * (contrast - 1) / (contrast + 1), rel=1e-10
    )


@pytest.mark.parametrize("coating", [SOFT, BORON])
def test_few_coated_fibres_have_the_slope_of_one(coating):
    """The self-consistent estimate and the slope are Eshelby's integral in two ways.

    With the whole composite around, and with the matrix alone.
    """
    fraction, share = 1e-5, 0.7
    radius = np.sqrt(fraction)
    layers = [(GLASS, np.sqrt(share) * radius), (coating, radius)]
    K, *_, G_axial = constants_of([*layers, (EPOXY, 1.0)])
    assert (K - EPOXY.K_transverse) / fraction == pytest.approx(dilute_bulk(EPOXY, layers), rel=1e-4)
    assert (G_axial - EPOXY.G_axial) / fraction == pytest.approx(dilute_axial_shear(EPOXY, layers), rel=1e-4)

    def medium(shear):
        return dataclasses.replace(EPOXY, G_transverse=shear, K_transverse=K)

    found = (self_consistent_shear([*layers, (EPOXY, 1.0)], medium) - EPOXY.G_transverse) / fraction
    assert found == pytest.approx(dilute_shear(EPOXY, layers), rel=1e-4)


def test_the_series_of_coated_fibres_begins_with_composite_cylinders():
    fraction, share = 0.05, 0.8
    expected = constants_of([(GLASS, np.sqrt(share * fraction)), (SOFT, np.sqrt(fraction)), (EPOXY, 1.0)])[3]
    contrast = layered_contrast(GLASS.G_axial / EPOXY.G_axial, SOFT.G_axial / EPOXY.G_axial, share)
    found = axial_shear_modulus("hexagonal", fraction, contrast) * EPOXY.G_axial
    assert found == pytest.approx(expected, rel=1e-7)
    assert axial_shear_modulus("square", 0.4, layered_contrast(5.0, 5.0, share)) == axial_shear_modulus(
        "square", 0.4, 5.0
    )
