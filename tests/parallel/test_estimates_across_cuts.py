"""Estimated errors of the mesh where bodies are cut, against those of bodies that are not."""

import numpy as np
import pytest
from mpi4py import MPI
from support.cases import case_of, make_case, solve

from feti_homog import run
from feti_homog.homogenization.mesh_estimate import energy_errors
from feti_homog.homogenization.partition_policy import BY_COST, DEFAULT_POLICY

pytestmark = pytest.mark.parallel

VOIDS = {"geometry": "random", "fibres": 2, "fibre_fraction": 0.2, "voids": 0.1, "mesh_size": 0.25}
SPRINGS = {"normal_stiffness": 1000.0, "tangential_stiffness": 250.0, "contact": False}
RTOL = {"feti_ksp_rtol": 1e-10}


def estimate(comm, subdomains, plane="strain", cell=None, **sections):
    """Return the estimates of a hexagonal cell of so many subdomains.  Collective."""
    cell = {"geometry": "hexagonal", "fibre_fraction": 0.4} | (cell or {})
    sections = {"decomposition": {"cut": "bodies", "subdomains": subdomains}, "petsc": RTOL} | sections
    return run(case_of(cell, plane=plane, **sections), comm).mesh_error.effective_stiffness


def errors(comm, cell, cut, policy, **more):
    """Return estimates on the mesh itself, and what each element has in them, in an order that no cut changes."""
    torn, _, responses = solve(make_case(**cell, decomposition=cut, **more), comm, policy=policy)
    found = energy_errors(torn, responses, nested=False)
    middles = [part.mesh.points[part.mesh.triangles[:, :3]].mean(axis=1) for part in torn.parts]
    rows = np.column_stack([np.concatenate([np.zeros((0, 2)), *middles]) % torn.summary.shift, found.shares])
    rows = np.concatenate(comm.allgather(rows))
    torn.destroy()
    return found, rows[np.lexsort(np.round(rows[:, :2], 9).T), 2:]


@pytest.mark.parametrize(
    "cell",
    [
        {"order": 1, "refine": 0, "bodies": "plane"},
        {"order": 1, "refine": 1, "mesh_size": 0.25},
        {"order": 2, "refine": 1, "mesh_size": 0.3, "bodies": "plane"},
        {"order": 2, "refine": 0, "mesh_size": 0.25, "matrix": {"young": 88.0, "poisson": 0.4999}},
        VOIDS | {"order": 1, "refine": 0},
    ],
    ids=["linear", "refined", "quadratic", "mixed", "voids"],
)
def test_no_cut_changes_them(comm, cell):
    whole, shares = errors(MPI.COMM_SELF, cell, {"cut": "bodies"}, DEFAULT_POLICY)
    for cut, policy in (({"subdomains": 7}, DEFAULT_POLICY), ({"subdomains": 4}, BY_COST), ({}, BY_COST)):
        found, own = errors(comm, cell, cut, policy)
        for part in ("elements", "arcs"):
            expected = getattr(whole, part)
            np.testing.assert_allclose(getattr(found, part), expected, atol=1e-8 * np.abs(expected).max())
        np.testing.assert_allclose(own, shares, atol=1e-8 * shares.max())


def test_no_cut_changes_those_along_the_fibres(comm):
    whole, cut = (estimate(on, n, "generalized", {"mesh_size": 0.2}) for on, n in ((MPI.COMM_SELF, 3), (comm, 12)))
    np.testing.assert_allclose(cut, whole, atol=1e-8 * whole.max())


@pytest.mark.parametrize("order", [1, 2])
def test_cuts_hardly_matter_on_the_mesh_refined_less(comm, order):
    cell = {"mesh_size": 0.05 * order, "refine": 1, "order": order}
    whole, cut = (estimate(comm, n, cell=cell, interface=SPRINGS)[:2, :2] for n in (3, 12))
    np.testing.assert_allclose(cut, whole, rtol=0.01 if order == 1 else 0.1)


def test_no_cut_changes_those_of_nearly_incompressible_phases(comm):
    """Between given displacements, the pressure of a piece on a coarser mesh is its volume change times 1e8."""
    phases = {"matrix": {"young": 3.0, "poisson": 0.49999999}, "fibre": {"young": 70.0, "poisson": 0.2}}
    cell = {"geometry": "square", "mesh_size": 0.1, "refine": 1, "order": 2}
    whole, cut = (estimate(on, n, cell=cell, material=phases) for on, n in ((MPI.COMM_SELF, 3), (comm, 9)))
    np.testing.assert_allclose(cut, whole, rtol=1e-3)
    assert cut[0, 0] == pytest.approx(126.51333 - 126.51290, rel=0.3)  # against a mesh refined four times


def test_no_cut_moves_a_free_fibre(comm):
    """It may lie anywhere in its hole, turned by any angle."""
    free = {"contact": True, "debonded": [{"fibre": 1, "centre": 0.0, "angle": 360.0}]}
    cell = {"geometry": "hexagonal", "fibre_fraction": 0.3, "mesh_size": 0.25}
    sections = {"load": {"to": {"E11": 0.01, "E22": -0.01}}, "interface": free, "petsc": RTOL}
    whole, cut = (
        run(case_of(cell, decomposition={"subdomains": n}, **sections), on).load.mesh_error
        for on, n in ((MPI.COMM_SELF, 3), (comm, 9))
    )
    assert abs(cut - whole) < 1e-8 * whole
