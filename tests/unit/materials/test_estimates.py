"""Estimates against exact relations, bounds, limits and cells that were solved."""

import dataclasses

import numpy as np
import pytest
from reference.fibre_composites import (
    ALUMINIUM,
    AXIAL_SHEAR,
    CARBON,
    CONTRASTS,
    EPOXY,
    GLASS,
    HEXAGONAL,
    SOFT_EPOXY,
    SQUARE,
    compliance,
    fibre_like,
    isotropic,
)

from feti_homog.materials.engineering_constants import transversely_isotropic_part
from feti_homog.materials.estimates import METHODS, estimates
from feti_homog.materials.laws import plane_stiffness
from feti_homog.materials.material_forms import Isotropic
from feti_homog.materials.phase_bounds import CONSTANTS, NOTHING, Fibres, Springs, fibre_bounds, hashin_shtrikman

ANISOTROPIC_MATRIX = fibre_like(5.0, 3.0, 0.3, 0.4, 1.7, 40.0, 60.0)
PAIRS = [(ALUMINIUM, isotropic(379.3, 0.1, 8.1)), (EPOXY, CARBON), (SOFT_EPOXY, GLASS), (ANISOTROPIC_MATRIX, CARBON)]
ALL_OF_THEM = ("mori_tanaka", "self_consistent")
every_pair = pytest.mark.parametrize(("matrix", "fibre"), PAIRS)
every_composite = pytest.mark.parametrize("composite", HEXAGONAL.values(), ids=HEXAGONAL.keys())


def given(estimate):
    """Return the values of an estimate by name."""
    return {name: value for name, value in dataclasses.asdict(estimate).items() if value is not None}


def of(constants, names):
    return {name: getattr(constants, name) for name in names}


@every_pair
@pytest.mark.parametrize("name", METHODS)
def test_no_fibres_are_the_matrix_and_all_fibres_the_fibre(name, matrix, fibre):
    for fraction, phase in ((0.0, matrix), (1.0, fibre)):
        found = given(METHODS[name](matrix, [Fibres(fraction, fibre)]))
        assert found == pytest.approx(of(phase, found), rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("phase", [ANISOTROPIC_MATRIX, CARBON, GLASS])
@pytest.mark.parametrize("name", METHODS)
def test_fibres_like_the_matrix_make_the_matrix(name, phase):
    found = given(METHODS[name](phase, [Fibres(0.4, phase)]))
    if name == "chamis":  # whose transverse expansion of the matrix between rigid fibres is not that of free ones
        del found["expansion_transverse"]
    assert found == pytest.approx(of(phase, found), rel=1e-12)


@every_pair
@pytest.mark.parametrize("name", METHODS)
def test_constants_of_one_estimate_belong_to_one_material(name, matrix, fibre):
    found = METHODS[name](matrix, [Fibres(0.55, fibre)])
    if found.nu_transverse is None:
        return
    assert found.E_transverse == pytest.approx(2 * found.G_transverse * (1 + found.nu_transverse), rel=1e-12)
    if found.K_transverse is None:
        return
    S = compliance(found.E_axial, found.E_transverse, found.nu_axial, found.nu_transverse, found.G_axial)
    stiffness = np.linalg.inv(S)
    assert (stiffness[0, 0] + stiffness[0, 1]) / 2 == pytest.approx(found.K_transverse, rel=1e-10)
    assert np.linalg.eigvalsh(stiffness).min() > 0


@every_pair
@pytest.mark.parametrize("name", [*ALL_OF_THEM, "composite_cylinders"])
@pytest.mark.parametrize("c", [0.1, 0.5, 0.9])
def test_hills_relations_hold_between_bulk_modulus_and_axial_constants(name, matrix, fibre, c):
    found = METHODS[name](matrix, [Fibres(c, fibre)])
    mean = {x: c * getattr(fibre, x) + (1 - c) * getattr(matrix, x) for x in ("E_axial", "nu_axial")}
    d = (fibre.nu_axial - matrix.nu_axial) / (1 / fibre.K_transverse - 1 / matrix.K_transverse)
    b = c / fibre.K_transverse + (1 - c) / matrix.K_transverse - 1 / found.K_transverse
    assert found.E_axial == pytest.approx(mean["E_axial"] + 4 * d**2 * b, rel=1e-12)
    assert found.nu_axial == pytest.approx(mean["nu_axial"] - d * b, rel=1e-12)


@every_pair
@pytest.mark.parametrize("name", ALL_OF_THEM)
def test_levins_relation_holds_between_compliance_and_expansion(name, matrix, fibre):
    c = 0.55
    found = METHODS[name](matrix, [Fibres(c, fibre)])
    Sf, Sm, S = (
        compliance(x.E_axial, x.E_transverse, x.nu_axial, x.nu_transverse, x.G_axial)[:3, :3]
        for x in (fibre, matrix, found)
    )
    af, am = (np.array([x.expansion_transverse] * 2 + [x.expansion_axial]) for x in (fibre, matrix))
    expected = c * af + (1 - c) * am + (S - c * Sf - (1 - c) * Sm) @ np.linalg.solve(Sf - Sm, af - am)
    assert found.expansion_axial == pytest.approx(expected[2], rel=1e-9, abs=1e-9)
    assert [found.expansion_transverse] * 2 == pytest.approx(expected[:2], rel=1e-9)


@every_pair
def test_mori_tanaka_is_the_lower_bound_where_the_matrix_is_softer(matrix, fibre):
    found, bounds = METHODS["mori_tanaka"](matrix, [Fibres(0.6, fibre)]), fibre_bounds([0.4, 0.6], [matrix, fibre])
    swapped = METHODS["mori_tanaka"](fibre, [Fibres(0.4, matrix)])
    for name in ("K_transverse", "G_transverse", "G_axial", "E_axial"):
        assert (getattr(found, name), getattr(swapped, name)) == pytest.approx(getattr(bounds, name), rel=1e-12)
    assert sorted((found.nu_axial, swapped.nu_axial)) == pytest.approx(bounds.nu_axial, rel=1e-12)


@every_pair
def test_moduli_of_halpin_and_tsai_that_are_not_fitted_are_mori_and_tanakas(matrix, fibre):
    found, expected = (METHODS[name](matrix, [Fibres(0.6, fibre)]) for name in ("halpin_tsai", "mori_tanaka"))
    names = ("G_axial", "G_transverse", "K_transverse")
    assert of(found, names) == pytest.approx(of(expected, names), rel=1e-12)


def test_the_transverse_expansion_of_chamis_is_that_of_his_report():
    """alpha_T = sqrt(c) alpha_Tf + (1 - sqrt(c)) (1 + c nu_m E_f / E_A) alpha_m, at c = 0.49 of an isotropic matrix."""
    matrix, fibre = EPOXY, CARBON
    E = 0.49 * fibre.E_axial + 0.51 * matrix.E_axial
    expected = 0.7 * fibre.expansion_transverse
    expected += 0.3 * (1 + 0.49 * matrix.nu_axial * fibre.E_axial / E) * matrix.expansion_axial
    found = METHODS["chamis"](matrix, [Fibres(0.49, fibre)])
    assert found.expansion_transverse == pytest.approx(expected, rel=1e-12)


def random_phase(rng):
    """Transversely isotropic, of moduli between 1e-3 and 1e3 and any stable contractions."""
    while True:
        (E_L, E_T, G), nu_L, nu_T = 10 ** rng.uniform(-3, 3, 3), rng.uniform(-0.3, 0.5), rng.uniform(-0.4, 0.9)
        if 1 - nu_T - 2 * nu_L**2 * E_T / E_L > 0.01:
            return fibre_like(E_L, E_T, nu_L, nu_T, G)


@pytest.mark.parametrize("seed", range(5))
def test_estimates_of_random_phases_lie_within_the_bounds_and_springs_soften(seed):
    rng = np.random.default_rng(seed)
    for _ in range(20):
        matrix, fibre, c = random_phase(rng), random_phase(rng), rng.uniform()
        bounds = fibre_bounds([1 - c, c], [matrix, fibre])
        for name in ALL_OF_THEM:
            found = METHODS[name](matrix, [Fibres(c, fibre)])
            for constant in ("E_axial", "nu_axial", "G_axial", "G_transverse", "K_transverse"):
                lower, upper = getattr(bounds, constant)
                slack = 1e-9 * max(abs(lower), abs(upper))
                assert lower - slack <= getattr(found, constant) <= upper + slack
            soft = METHODS[name](matrix, [Fibres(c, fibre, Springs(*10 ** rng.uniform(-3, 3, 3), 0.3))])
            for constant in ("G_axial", "G_transverse", "K_transverse"):
                assert 0 < getattr(soft, constant) <= getattr(found, constant)


def test_bounds_of_isotropic_phases_are_those_of_hashin_and_shtrikman():
    bounds = fibre_bounds([0.6, 0.4], [isotropic(88.0, 0.299), isotropic(200.0, 0.222)])
    plane = hashin_shtrikman(
        [0.6, 0.4], [plane_stiffness(Isotropic(*x), "strain") for x in ((88, 0.299), (200, 0.222))]
    )
    assert bounds.K_transverse == pytest.approx(plane.bulk, rel=1e-12)
    assert bounds.G_transverse == pytest.approx(plane.shear, rel=1e-12)


def test_square_cell_lies_within_the_bounds_of_square_symmetry():
    composite = SQUARE["boron/aluminium"]
    bounds = fibre_bounds([1 - composite.fraction, composite.fraction], [composite.matrix, composite.fibre])
    values = {"E_axial": composite.constants[0], "nu_axial": composite.constants[4], "G_axial": composite.constants[2]}
    for name, value in (values | {"K_transverse": bulk(composite)}).items():
        lower, upper = getattr(bounds, name)
        assert lower < value < upper, name
    assert composite.constants[3] < bounds.G_transverse[0]  # its shear modulus in these axes is not isotropic


def bulk(composite):
    """Plane strain bulk modulus of a cell, by the inverse of its compliance."""
    E_L, E_T, _, _, nu_L, nu_T, *_ = composite.constants
    stiffness = np.linalg.inv(compliance(E_L, E_T, nu_L, nu_T, 1.0))
    return (stiffness[0, 0] + stiffness[0, 1]) / 2


@every_composite
def test_hexagonal_cells_are_nearly_composite_cylinders(composite):
    E_L, _, G_L, G_T, nu_L, _, alpha_L, alpha_T = composite.constants
    fibres = [Fibres(composite.fraction, composite.fibre)]
    found = METHODS["self_consistent"](composite.matrix, fibres)
    assert (found.E_axial, found.nu_axial) == pytest.approx((E_L, nu_L), rel=2e-4)
    assert found.K_transverse == pytest.approx(bulk(composite), rel=5e-3)
    assert found.G_axial == pytest.approx(G_L, rel=5e-3)
    assert (found.expansion_axial, found.expansion_transverse) == pytest.approx((alpha_L, alpha_T), rel=0, abs=0.03)
    assert METHODS["mori_tanaka"](composite.matrix, fibres).G_transverse < G_T < found.G_transverse < 1.04 * G_T


@pytest.mark.parametrize(("arrangement", "c"), AXIAL_SHEAR)
def test_axial_shear_of_square_and_hexagonal_cells(arrangement, c):
    for contrast, value in zip(CONTRASTS, AXIAL_SHEAR[arrangement, c], strict=True):
        matrix, fibre = isotropic(2.5, 0.25), isotropic(2.5 * contrast, 0.25)
        lower, upper = fibre_bounds([1 - c, c], [matrix, fibre]).G_axial
        assert lower - 2e-6 < value < upper
        if c <= 0.3:
            assert value == pytest.approx(lower, rel=2e-3)


def test_equal_families_are_one():
    one = vars(estimates(EPOXY, [Fibres(0.6, CARBON)]))
    two = vars(estimates(EPOXY, [Fibres(0.2, CARBON), Fibres(0.4, CARBON)]))
    for name in ("rule_of_mixtures", "mori_tanaka"):
        assert given(two[name]) == pytest.approx(given(one[name]), rel=1e-12)


def test_methods_say_nothing_of_what_they_do_not_know():
    found = vars(estimates(EPOXY, [Fibres(0.3, CARBON), Fibres(0.2, GLASS)]))
    assert [name for name, estimate in found.items() if estimate != NOTHING] == ["rule_of_mixtures", "mori_tanaka"]
    assert given(found["mori_tanaka"]).keys() == set(CONSTANTS)
    found = vars(estimates(EPOXY, [Fibres(0.3, CARBON, Springs(100.0, 50.0, 20.0, 0.3))]))
    spoken = [name for name, estimate in found.items() if estimate != NOTHING]
    assert spoken == ["mori_tanaka", "composite_cylinders", "self_consistent"]
    skew = transversely_isotropic_part(np.diag([5.0, 4.0, 9.0, 1.0, 1.0, 1.0]))
    assert set(vars(estimates(skew, [Fibres(0.3, GLASS)])).values()) == {NOTHING}
    assert set(vars(estimates(GLASS, [Fibres(0.3, skew)])).values()) == {NOTHING}
    bare = dataclasses.replace(CARBON, expansion_axial=None, expansion_transverse=None)
    for found in vars(estimates(EPOXY, [Fibres(0.3, bare)])).values():
        assert (found.expansion_axial, found.expansion_transverse) == (None, None)
        assert found.E_axial is not None
