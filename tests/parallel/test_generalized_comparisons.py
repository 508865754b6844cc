"""Estimates and bounds beside a cell are those of its own interfaces and shapes, or are left out."""

import pytest
from support.ranks import parallel_assert
from support.spatial_cells import EPOXY, GLASS, solved

pytestmark = [pytest.mark.parallel, pytest.mark.few_ranks]

CELL = {"width": 0.05, "mesh_size": 0.1, "order": 2}
ROUND = ("mori_tanaka", "composite_cylinders", "self_consistent")


@pytest.mark.parametrize(
    "springs",
    [
        {"normal_stiffness": 100.0, "tangential_stiffness": 50.0, "axial_stiffness": 5.0},
        {"normal_stiffness": 100.0, "tangential_stiffness": 50.0},
        {"axial_stiffness": 5.0},
    ],
    ids=["all", "the plane's", "axial alone"],
)
def test_estimates_know_the_springs_along_the_fibres(comm, springs):
    """In a square cell axial shear is that of composite cylinders within few per cent."""
    result = solved(comm, sections={"interface": springs}, **CELL)
    own = result.transversely_isotropic.G_axial
    for name in ROUND:
        estimate = getattr(result.estimates, name).G_axial
        parallel_assert(comm, estimate == pytest.approx(own, rel=0.03), f"{name}: {estimate}, {own} of the cell")
    parallel_assert(comm, result.fibre_bounds is None)
    parallel_assert(comm, result.estimates.chamis.G_axial is None)


def test_rigid_bonds_have_bounds(comm):
    result = solved(comm, **CELL)
    lower, upper = result.fibre_bounds.G_axial
    parallel_assert(comm, lower < result.transversely_isotropic.G_axial < upper)


def test_a_stiffness_of_secants_has_nothing_that_follows_from_it(comm):
    """Each of its columns is that of another state of contact."""
    arcs = {"interface": {"debonded": [{"fibre": "all", "angle": 360.0}]}}
    result = solved(comm, sections=arcs, **CELL)
    parallel_assert(comm, result.effective_stiffness_compression is not None)
    for name in ("compliance", "constants", "transversely_isotropic", "thermal_expansion", "estimates", "fibre_bounds"):
        parallel_assert(comm, getattr(result, name) is None, name)


def test_free_faces_have_a_compliance_and_no_estimates(comm):
    arcs = {"interface": {"contact": False, "debonded": [{"fibre": "all", "angle": 90.0}]}}
    result = solved(comm, sections=arcs, **CELL)
    parallel_assert(comm, result.compliance is not None and result.constants is not None)
    parallel_assert(comm, result.estimates is None and result.fibre_bounds is None)


def test_coated_fibres_have_bounds_and_no_estimates(comm):
    """A coating is no fibre: estimates of cylinders beside each other do not hold for cylinders within each other."""
    material = {"matrix": EPOXY, "fibre": GLASS, "coating": {"young": 1.0, "poisson": 0.3}}
    result = solved(comm, sections={"material": material}, coating=0.2, **CELL)
    lower, upper = result.fibre_bounds.G_axial
    parallel_assert(comm, lower < result.transversely_isotropic.G_axial < upper and result.estimates is None)
