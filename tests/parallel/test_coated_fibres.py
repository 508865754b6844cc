"""Cells of coated fibres against closed forms, plain cells and elastic interfaces."""

import numpy as np
import pytest
from support.cases import case_of
from support.ranks import assert_certified

from feti_homog import run

pytestmark = [pytest.mark.parallel, pytest.mark.few_ranks]

MATRIX, FIBRE = (3.0, 0.35), (70.0, 0.2)
TIGHT = {"feti_ksp_rtol": 1e-8}


def phases_of(**phases):
    return {name: dict(zip(("young", "poisson"), own, strict=True)) for name, own in phases.items()}


def result_of(coating, thickness=None, interface=None, **cell):
    materials = phases_of(matrix=MATRIX, fibre=FIBRE, **({} if thickness is None else {"coating": coating}))
    cell = {"geometry": "square", "mesh_size": 0.1, "order": 2, "refine": 1} | cell
    cell |= {} if thickness is None else {"coating": thickness}
    result = run(case_of(cell, material=materials, petsc=TIGHT, interface=interface))
    assert result.status == "done"
    return result


def moduli(phase):
    """Plane strain bulk modulus lambda + G, and G."""
    young, poisson = phase
    shear = young / (2 * (1 + poisson))
    return shear / (1 - 2 * poisson), shear


def cylinder(matrix_bulk, matrix_shear, fibre_bulk, share):
    """Z. Hashin, B. W. Rosen, J. Appl. Mech. 31, 1964: bulk modulus of a composite cylinder."""
    return matrix_bulk + share / (1 / (fibre_bulk - matrix_bulk) + (1 - share) / (matrix_bulk + matrix_shear))


@pytest.mark.parametrize("coating", [(0.3, 0.35), (20.0, 0.3)])
def test_bulk_modulus_is_that_of_a_cylinder_of_cylinders(coating):
    """At a tenth of coated fibres the square cell departs from it by less than 1e-4."""
    share, thickness = 0.08, 0.1
    outer = share * (1 + thickness) ** 2
    coated = cylinder(*moduli(coating), moduli(FIBRE)[0], share / outer)
    expected = cylinder(*moduli(MATRIX), coated, outer)
    result = result_of(coating, thickness, fibre_fraction=share)
    assert result.moduli.bulk == pytest.approx(expected, rel=3e-4)
    assert result.cell.fibre_fraction == pytest.approx(share, rel=1e-4)
    (fibre,) = result.fibres
    assert fibre.coating == pytest.approx(thickness * fibre.radius, rel=1e-9)
    assert result.cell.fractions["coating"] == pytest.approx(outer - share, rel=1e-3)


@pytest.mark.one_rank
def test_soft_coatings_tend_to_elastic_interfaces():
    """k_n = (lambda + 2 G) / t and k_t = G / t, as t / a falls with the stiffness: an error of the first order in t."""
    share, poisson, errors = 0.3, 0.3, []
    radius = np.sqrt(share / np.pi)
    for thickness in (0.04, 0.02):
        young = thickness * 3.0
        bulk, shear = moduli((young, poisson))
        t = thickness * radius
        springs = {"normal_stiffness": (bulk + shear) / t, "tangential_stiffness": shear / t}
        coated = result_of((young, poisson), thickness, fibre_fraction=share).effective_stiffness
        glued = result_of(None, interface=springs, fibre_fraction=share).effective_stiffness
        errors.append(np.abs(coated - glued).max())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(1.0, abs=0.1)


@pytest.mark.one_rank
@pytest.mark.parametrize("young", [3e-3, 3e3])
def test_thin_coatings_take_few_iterations(young):
    cell = {"geometry": "random", "fibres": 6, "min_gap": 0.1, "order": 1, "fibre_fraction": 0.4}
    result = result_of((young, 0.3), 0.01, **cell)
    assert max(result.solver.iterations) < 25


@pytest.mark.parametrize("thickness", [0.05, 0.01])
def test_thin_coatings_obey_every_law(comm, shared_path, thickness):
    cell = {"geometry": "square", "mesh_size": 0.1, "fibre_fraction": 0.3, "coating": thickness, "order": 2}
    phases = phases_of(matrix=MATRIX, fibre=FIBRE, coating=(1.0, 0.35))
    run(case_of(cell, material=phases, petsc={}), out=shared_path / "result", comm=comm)
    assert_certified(comm, shared_path / "result")


@pytest.mark.one_rank
def test_stiff_coatings_that_float_are_in_equilibrium(comm, shared_path):
    """Balance forces to their own rounding at 1e5 times the stiffness around, free or rubbing."""
    whole = {"debonded": [{"fibre": 1, "angle": 360.0}]}
    outer, inner = {"between": ["coating", "matrix"], "friction": 0.3}, {"between": ["fibre", "coating"]}
    case = case_of(
        {"geometry": "square", "fibre_fraction": 0.3, "mesh_size": 0.15, "coating": 0.1},
        material=phases_of(matrix=(1.0, 0.3), fibre=(9.0, 0.3), coating=(1e5, 0.3)),
        interface=[outer | whole, inner | whole],
        path={"waypoints": [{"E11": -0.01, "E22": -0.004}, {"gamma12": 0.02}]},
        output={"pictures": False, "states": "all"},
        petsc={},
    )
    result = run(case, comm, out=shared_path / "out")
    assert result.path[-1].debonding_angle == pytest.approx([360.0])  # of both interfaces together
    assert_certified(comm, shared_path / "out")
