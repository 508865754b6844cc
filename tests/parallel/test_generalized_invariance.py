"""Generalized plane strain does not depend on axes, ranks, cuts, operators and coarse spaces."""

import pytest
from mpi4py import MPI
from support.generalized_phases import CRYSTAL, WOOD
from support.spatial_cells import EPOXY, GLASS, error, solved

pytestmark = [pytest.mark.parallel, pytest.mark.few_ranks]

EXACT = 1e-9
PHASES = {"matrix": WOOD, "fibre": CRYSTAL}


def same(found, expected, tolerance=EXACT):
    """Return whether two results have the same secants and thermal stress, under loads of either sign."""
    names = ("effective_stiffness", "thermal_stress", "effective_stiffness_compression", "thermal_stress_compression")
    pairs = [(getattr(found, name), getattr(expected, name)) for name in names]
    return all(one is other is None or error(one, other) < tolerance for one, other in pairs)


HEXAGONAL = {"geometry": "hexagonal", "mesh_size": 0.12} | PHASES
WAYS = {
    "cut": {"sections": {"decomposition": {"subdomains": 9}}},
    "bodies cut by the cell": {"bodies": "plane"},
    "implicit": {"petsc": {"feti_dual_operator": "implicit"}},
    "explicit": {"petsc": {"feti_dual_operator": "explicit"}},
    "adaptive": {
        "petsc": {"feti_coarse_space": "adaptive", "feti_pc_type": "dirichlet"},
        "sections": {"decomposition": {"subdomains": 9}},
    },
    "natural": {"petsc": {"feti_coarse_space": "natural"}, "sections": {"decomposition": {"subdomains": 9}}},
    "influence": {"petsc": {"feti_pc_type": "influence"}},
    "lumped, mumps": {"petsc": {"feti_pc_type": "lumped", "feti_sub_pc_factor_mat_solver_type": "mumps"}},
}


@pytest.fixture(scope="module")
def by_default():
    return solved(MPI.COMM_WORLD, **HEXAGONAL)


@pytest.mark.quick
@pytest.mark.parametrize("way", WAYS.values(), ids=WAYS)
def test_every_way_to_solve_gives_the_same(comm, by_default, way):
    assert same(solved(comm, **HEXAGONAL, **way), by_default)


@pytest.mark.parametrize(("contrast", "pieces"), [(1e-3, {"subdomains": 16}), (1e3, {})], ids=["cut", "whole"])
def test_axial_shear_takes_few_iterations(comm, contrast, pieces):
    fibre = {"young": contrast, "poisson": 0.2}
    cell = {"geometry": "hexagonal", "mesh_size": 0.08, "refine": 1, "order": 2}
    petsc = {"feti_ksp_rtol": 1e-10}
    result = solved(comm, matrix=EPOXY, fibre=fibre, **cell, petsc=petsc, sections={"decomposition": pieces})
    axial = result.solver.iterations[4:]
    assert len(axial) == 2 and max(axial) < 30


@pytest.mark.parametrize("name", ["matrix", "fibre"])
def test_a_phase_without_expansion_leaves_it_unknown(comm, name):
    phases = {"matrix": dict(EPOXY), "fibre": dict(GLASS)}
    del phases[name]["expansion"]
    result = solved(comm, **phases)
    assert result.thermal_stress is None and result.thermal_expansion is None
    assert error(result.effective_stiffness, solved(comm).effective_stiffness) < EXACT
