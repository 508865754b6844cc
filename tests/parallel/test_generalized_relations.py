"""Generalized plane strain against exact relations, on coarse meshes and at any number of ranks.

Where the fields of two phases are uniform, or those of layers, finite elements of any size have no error.
"""

from pathlib import Path

import numpy as np
import pytest
from reference.spatial_forms import (
    IN_PLANE,
    ONES,
    axial_constants,
    hill,
    laminate,
    law,
    levin,
)
from support.generalized_phases import CARBON, CRYSTAL, WOOD
from support.ranks import write_once
from support.spatial_cells import EPOXY, GLASS, error, solved
from unit.mesh.faulty_meshes import grid

pytestmark = [pytest.mark.parallel, pytest.mark.few_ranks]

EXACT = 1e-9
MESHES = Path(__file__).parents[2] / "meshes"
ARRANGEMENTS = {
    "square": {"geometry": "square"},
    "hexagonal": {"geometry": "hexagonal", "order": 2, "mesh_size": 0.3},
    "random": {"geometry": "random", "fibres": 3, "min_gap": 0.1, "seed": 5, "bodies": "plane"},
    "file": {"geometry": "mesh", "file": "two_fibres.msh", "folder": MESHES},
}


def fractions(result):
    """(2,) shares of matrix and fibres in the meshed area."""
    return np.array([1.0 - result.cell.fibre_fraction, result.cell.fibre_fraction])


def bulk_modulus(C):
    """K23: mean stress over twice the strain across under hydrostatic stress, without strain along x3."""
    return 1 / np.linalg.inv(C[np.ix_(IN_PLANE, IN_PLANE)])[:2, :2].sum()


@pytest.mark.quick
@pytest.mark.parametrize("cell", ARRANGEMENTS.values(), ids=ARRANGEMENTS)
@pytest.mark.parametrize("fibre", [GLASS, CARBON], ids=["glass", "carbon"])
def test_axial_constants_and_expansion_follow_from_the_rest(comm, cell, fibre):
    result = solved(comm, fibre=fibre, **cell)
    C, S, c = result.effective_stiffness, result.compliance, fractions(result)
    E, nu = hill(EPOXY, fibre, c, bulk_modulus(C))
    assert 1 / S[2, 2] == pytest.approx(E, rel=EXACT)
    # The mean of both directions, if the arrangement has no axis.
    assert -(S[0, 2] + S[1, 2]) / (2 * S[2, 2]) == pytest.approx(nu, rel=EXACT)
    # Strains [e, e, E33] that make the same stress across in both phases are uniform.
    _, nu, k = np.transpose([axial_constants(EPOXY), axial_constants(fibre)])
    across = -(k[1] * nu[1] - k[0] * nu[0]) / (k[1] - k[0])
    uniform = np.array([across, across, 1.0, 0, 0, 0])
    stresses = [law(phase)[0] @ uniform for phase in (EPOXY, fibre)]
    assert stresses[0][:2] == pytest.approx(stresses[1][:2], rel=1e-12)
    assert error(C @ uniform, c @ stresses) < EXACT
    assert error(result.thermal_expansion, levin(EPOXY, fibre, c, S)) < EXACT


@pytest.mark.parametrize("phase", [EPOXY, CARBON, WOOD, CRYSTAL], ids=["epoxy", "carbon", "wood", "crystal"])
@pytest.mark.parametrize("cell", [ARRANGEMENTS["square"], ARRANGEMENTS["hexagonal"]], ids=["square", "hexagonal"])
def test_homogeneous_cell_is_its_phase(comm, cell, phase):
    result = solved(comm, matrix=phase, fibre=phase, **cell)
    C, alpha = law(phase)
    assert error(result.effective_stiffness, C) < EXACT and error(result.thermal_expansion, alpha) < EXACT
    assert error(result.compliance, np.linalg.inv(C)) < EXACT
    # Nothing but what has to vanishes, so that no entry can stand for another.
    if "E1" in phase:
        entries = np.abs(C[np.triu_indices(6)])
        assert len(np.unique(entries[entries > 0].round(9))) == 13


def test_homogeneous_cell_without_a_plane_of_symmetry_across(comm):
    C = np.diag([30.0, 20.0, 25.0, 4.0, 6.0, 9.0])
    C[np.triu_indices(6, 1)] = [11.0, 7.0, 0, 0, 1.5, 8.0, 0, 0, -2.0, 0, 0, 0.7, 1.1, 0, 0]
    C = np.triu(C) + np.triu(C, 1).T
    phase = {"stiffness": C.tolist(), "expansion": [1.0, -2.0, 3.0]}
    result = solved(comm, matrix=phase, fibre=phase, mesh_size=0.3)
    assert error(result.effective_stiffness, C) < EXACT
    assert error(result.thermal_expansion, np.array([1.0, -2.0, 3.0, 0, 0, 0])) < EXACT


@pytest.mark.parametrize(("order", "across"), [(1, 0), (2, 1)])
@pytest.mark.parametrize("springs", [None, (700.0, 150.0), (3.0, 0.2)], ids=str)
def test_laminate_is_exact(comm, shared_path, across, order, springs):
    keys = ("normal_stiffness", "tangential_stiffness")
    sections = {"interface": dict(zip(keys, springs, strict=True))} if springs else {}
    write_once(comm, grid(lambda x, y: 0.25 < (x, y)[across] < 0.5), shared_path / "strips.msh")
    cell = {"geometry": "mesh", "file": "strips.msh", "folder": shared_path, "order": order}
    result = solved(comm, matrix=WOOD, fibre=CRYSTAL, sections=sections, **cell)
    C, thermal = laminate([law(WOOD), law(CRYSTAL)], [0.75, 0.25], across, springs or (np.inf, np.inf))
    assert error(result.effective_stiffness, C) < EXACT and error(result.thermal_stress, thermal) < EXACT


@pytest.mark.parametrize("springs", [1e-3, 1.0, 1e3])
def test_expansion_on_springs_is_that_of_any_phases_of_one_expansion(comm, springs):
    """Every stretch of the same size in all directions leaves springs alone."""
    sections = {"interface": {"normal_stiffness": springs, "tangential_stiffness": springs / 3}}
    phases = {"matrix": EPOXY | {"expansion": 7.0}, "fibre": GLASS | {"expansion": 7.0}}
    result = solved(comm, **phases, sections=sections, geometry="hexagonal")
    assert error(result.thermal_expansion, 7.0 * ONES) < 1e-8
