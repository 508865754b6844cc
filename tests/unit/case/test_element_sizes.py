"""The coarse mesh and its refinement that an accuracy chooses."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support import cases

from feti_homog.case.cell_sizes import COARSE_ERROR, SOFT_FACTOR, coarse_error
from feti_homog.materials.material_forms import Isotropic, TransverselyIsotropic

MATRIX = {"young": 3.5, "poisson": 0.35}
GEOMETRIES = {
    "square": {"geometry": "square", "fibre_fraction": 0.4},
    "hexagonal": {"geometry": "hexagonal", "fibre_fraction": 0.4},
    "random": {"geometry": "random", "fibre_fraction": 0.4, "fibres": 25},
    "mix": {"geometry": "random", "fibres": 25, "mix": {"fibre": 0.2, "glass": 0.2}},
    "table": {
        "geometry": "table", "width": 200.0, "height": 50.0,
        "fibre_list": [{"x": 25.0 + 50 * k, "y": 25.0, "radius": 10.0} for k in range(4)],
    },
}  # fmt: skip


def case_of(young=70.0, geometry="hexagonal", matrix=MATRIX, bonding=None, plane="strain", **cell):
    names = GEOMETRIES[geometry].get("mix", ["fibre"])
    materials = {"matrix": matrix} | {name: {"young": young, "poisson": 0.2} for name in names}
    return cases.case_of(GEOMETRIES[geometry] | cell, plane=plane, material=materials, interface=bonding)


def splits(*arguments, **more):
    return case_of(*arguments, **more).cell.refine


@pytest.mark.parametrize(
    ("geometry", "size"), {"square": 0.5, "hexagonal": 0.47, "random": 0.1, "mix": 0.1, "table": 0.12}.items()
)
def test_coarse_elements_are_half_the_pitch_of_the_fibres(geometry, size):
    """sqrt(area / fibres) / 2 / width: of the square cell 1/2, of four fibres in 4 x 1 squares 1/8."""
    assert case_of(geometry=geometry, accuracy=1e-3).cell.mesh_size == pytest.approx(size)


@settings(deadline=None, max_examples=40)
@given(st.floats(1e-6, 0.1), st.sampled_from([1, 2]))
def test_as_few_splits_as_the_estimate_allows(accuracy, order):
    materials = {"matrix": Isotropic(**MATRIX), "fibre": Isotropic(young=70.0, poisson=0.2)}
    error = coarse_error(materials, "strain", order, free_faces=False)
    refine = splits(order=order, accuracy=max(accuracy, 1e-5 if order == 1 else 0))
    asked = max(accuracy, 1e-5 if order == 1 else 0)
    assert error / 4 ** (order * refine) <= asked * (1 + 1e-12)
    assert refine == 0 or error / 4 ** (order * (refine - 1)) > asked


@pytest.mark.parametrize("young", [3.6, 4.5, 70.0, 0.01])
@pytest.mark.parametrize("accuracy", [0.1, 1e-2, 1e-3, 1e-4])
def test_an_accuracy_chooses_the_order_with_fewer_nodes(young, accuracy):
    nodes = {order: order**2 * 4 ** splits(young, order=order, accuracy=accuracy) for order in (1, 2)}
    cell = case_of(young, accuracy=accuracy).cell
    assert cell.order**2 * 4**cell.refine == min(nodes.values())
    assert cell.order == 1 or nodes[2] < nodes[1]


def test_the_estimate_of_isotropic_phases_in_closed_form():
    """In plane strain the eigenvalues are the ratios of the bulk moduli k = mu / (1 - 2 nu) and of the shear moduli mu.

    Kappa is the largest k / mu.
    """
    stiff, soft = Isotropic(young=70.0, poisson=0.2), Isotropic(**MATRIX)
    shear = (70.0 / 1.2) / (3.5 / 1.35)
    bulk = shear * 0.3 / 0.6
    beta = {ratio: (ratio - 1) / (ratio + 1) for ratio in (shear, bulk)}
    kappa = 1 / 0.3
    for order, constant in COARSE_ERROR.items():
        found = coarse_error({"matrix": soft, "fibre": stiff}, "strain", order, free_faces=False)
        assert found == pytest.approx(constant * kappa * beta[shear] ** 2)
        found = coarse_error({"matrix": stiff, "fibre": soft}, "strain", order, free_faces=False)
        assert found == pytest.approx(constant * kappa * SOFT_FACTOR * beta[shear] ** 2)


@pytest.mark.parametrize(("order", "kappa"), [(1, 1e4), (2, 33)])
def test_mixed_elements_err_no_more_with_a_phase_that_keeps_its_volume(order, kappa):
    matrix, fibre = Isotropic(young=1.0, poisson=0.49995), Isotropic(young=1e9, poisson=0.49995)
    found = coarse_error({"matrix": matrix, "fibre": fibre}, "strain", order, False)
    assert found == pytest.approx(COARSE_ERROR[order] * kappa)


def test_a_homogeneous_cell_needs_no_split():
    assert splits(3.5, matrix={"young": 3.5, "poisson": 0.2}, accuracy=1e-7) == 0


def test_more_contrast_asks_for_more_and_free_faces_for_most():
    even = {"matrix": {"young": 3.5, "poisson": 0.2}, "accuracy": 1e-4}
    for order in (1, 2):
        counts = [splits(young, order=order, **even) for young in (3.51, 4.5, 1e6, 1e-6)]
        assert counts == sorted(set(counts))
        part = {"contact": False, "debonded": [{"fibre": "all", "angle": 360.0}]}
        assert splits(4.5, order=order, bonding=part, **even) == counts[-1]


def test_a_coating_counts_on_both_of_its_sides():
    """A coating as stiff as the matrix, around a fibre that it alone touches."""
    fibre, matrix = Isotropic(young=3.5, poisson=0.3), Isotropic(young=70.0, poisson=0.3)
    coated = {"matrix": fibre, "fibre": fibre, "coating": matrix}
    assert coarse_error(coated, "strain", 1, False) == pytest.approx(
        coarse_error({"matrix": matrix, "fibre": fibre}, "strain", 1, False)
    )


def test_shear_along_the_fibres_counts_in_space_alone():
    fibre = TransverselyIsotropic(E_transverse=3.5, nu_transverse=0.35, E_axial=3.5, nu_axial=0.35, G_axial=30.0)
    phases = {"matrix": Isotropic(**MATRIX), "fibre": fibre}
    assert coarse_error(phases, "strain", 2, False) < 1e-12
    shear = 30.0 / (3.5 / 2.7)
    assert coarse_error(phases, "generalized", 2, False) == pytest.approx(
        COARSE_ERROR[2] / 0.3 * ((shear - 1) / (shear + 1)) ** 2
    )
