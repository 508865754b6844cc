"""Generalized plane strain against reference numbers and rates of convergence, at any number of ranks."""

from functools import cache

import numpy as np
import pytest
from reference.references import AXIAL_SHEAR, AXIAL_SHEAR_CONTRASTS, ENGINEERING_CONSTANTS
from reference.spatial_forms import axial_shear_modulus, stiffness_of_constants
from support.generalized_phases import ALUMINIUM, BORON, CARBON, CARBON_EPOXY
from support.spatial_cells import EPOXY, GLASS, solved

pytestmark = [pytest.mark.parallel, pytest.mark.one_rank]

PHASES = {"boron/aluminium": (ALUMINIUM, BORON), "AS4/3501-6": (CARBON_EPOXY, CARBON), "glass/epoxy": (EPOXY, GLASS)}
FINE = {"order": 2, "mesh_size": 0.1, "refine": 2, "petsc": {"feti_ksp_rtol": 1e-10}}
POISSON = 0.25

# Entries that do not vanish, of the square and the hexagonal cell.
ENTRIES = np.transpose([(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2), (3, 3), (4, 4), (5, 5)])


@pytest.fixture(scope="module")
def composite():
    """composite(key, order, refine): the result of a composite of `ENGINEERING_CONSTANTS`, once for each mesh."""
    from mpi4py import MPI

    @cache
    def made(key, order, refine):
        name, geometry, fraction = key
        matrix, fibre = PHASES[name]
        cell = {"geometry": geometry, "fibre_fraction": fraction}
        return solved(MPI.COMM_WORLD, matrix=matrix, fibre=fibre, **cell, **FINE | {"order": order, "refine": refine})

    return made


@pytest.mark.parametrize("key", ENGINEERING_CONSTANTS, ids=str)
def test_engineering_constants(composite, key):
    result = composite(key, 2, 2)
    S, alpha = result.compliance, result.thermal_expansion
    E1, E2, nu12, nu23 = 1 / S[2, 2], 1 / S[0, 0], -S[0, 2] / S[2, 2], -S[1, 0] / S[0, 0]
    found = [E1, E2, 1 / S[4, 4], 1 / S[5, 5], nu12, nu23, alpha[2], alpha[0]]
    assert found == pytest.approx(ENGINEERING_CONSTANTS[key].value, rel=1e-5)
    # Both directions across are alike.
    assert [1 / S[1, 1], 1 / S[3, 3], alpha[1]] == pytest.approx([E2, 1 / S[4, 4], alpha[0]], rel=2e-6)


@pytest.mark.parametrize(("order", "rate"), [(1, 1.8), (2, 3.7)])
def test_every_entry_converges(composite, order, rate):
    key = ("glass/epoxy", "hexagonal", 0.55)
    expected = stiffness_of_constants(*ENGINEERING_CONSTANTS[key].value[:6])
    coarse, fine = (
        np.abs(composite(key, order, refine).effective_stiffness - expected)[tuple(ENTRIES)] for refine in (1, 2)
    )
    assert (np.log2(coarse / fine) > rate).all()


@pytest.mark.parametrize("key", AXIAL_SHEAR, ids=str)
def test_the_series_gives_the_table(key):
    found = [axial_shear_modulus(*key, min(contrast, 1e30)) for contrast in AXIAL_SHEAR_CONTRASTS]
    assert found == pytest.approx(AXIAL_SHEAR[key].value, abs=AXIAL_SHEAR[key].error)


@pytest.mark.parametrize(
    ("key", "contrast"), list(zip(AXIAL_SHEAR, [10.0, 1e-6, 1e6, 2.0, 50.0, 1e-3], strict=True)), ids=str
)
def test_axial_shear_moduli(comm, key, contrast):
    geometry, fraction = key
    phases = {"matrix": {"young": 1.0, "poisson": POISSON}, "fibre": {"young": contrast, "poisson": POISSON}}
    C = solved(comm, **phases, geometry=geometry, fibre_fraction=fraction, **FINE).effective_stiffness
    G = C[3:5, 3:5] * 2 * (1 + POISSON)
    expected = axial_shear_modulus(geometry, fraction, contrast)
    assert np.abs(G - expected * np.eye(2)).max() < 2e-6 * expected
