"""L^ef of cells of tables with ellipses: Eshelby's solution, cells turned by a right angle, laws."""

import numpy as np
import pytest
from parallel.test_users_meshes import eshelby, plane_strain
from support.cases import FIBRE, MATRIX, case_of, monolithic_stiffness, relative_error, solve
from support.ranks import assert_certified

from feti_homog import run

pytestmark = [pytest.mark.parallel, pytest.mark.few_ranks]

ROWS = [
    {"x": 0.45, "y": 0.55, "a": 0.28, "b": 0.14, "angle": 30.0},
    {"x": 0.02, "y": 0.06, "a": 0.2, "b": 0.12, "angle": 100.0},
    {"x": 0.93, "y": 0.55, "radius": 0.1},
]


def table(rows, **cell):
    return {"geometry": "table", "width": 1.0, "height": 1.0, "fibre_list": rows, "mesh_size": 0.1} | cell


def solved(comm, rows, coating=None, **cell):
    materials = {"matrix": MATRIX, "fibre": FIBRE} | ({} if coating is None else {"coating": coating})
    return solve(case_of(table(rows, **cell), material=materials), comm)[:2]


def stiffness(comm, rows, coating=None, **cell):
    return solved(comm, rows, coating, **cell)[1]


@pytest.mark.quick
def test_few_ellipses_have_the_stiffness_of_eshelby(comm):
    """The dilute solution with the matrix's mean strain around (Mori and Tanaka); images err by their fraction f."""
    a, b = 0.08, 0.04
    found = stiffness(comm, [{"x": 0.5, "y": 0.5, "a": a, "b": b}], order=2)
    L, Lf = plane_strain(**MATRIX), plane_strain(**FIBRE)
    A = np.linalg.inv(np.eye(3) + eshelby(a, b, MATRIX["poisson"]) @ np.linalg.solve(L, Lf - L))
    f = np.pi * a * b
    raised = f * (Lf - L) @ A @ np.linalg.inv((1 - f) * np.eye(3) + f * A)
    assert np.abs(found - L - raised).max() < f * np.abs(raised).max()


@pytest.mark.one_rank
@pytest.mark.quick
@pytest.mark.parametrize("order", [1, 2])
def test_debonded_ellipse_obeys_every_law(comm, shared_path, order):
    arcs = {"contact": True, "debonded": [{"fibre": [1, 2], "centre": 40.0, "angle": 110.0}]}
    case = case_of(table(ROWS, mesh_size=0.15, order=order), interface=arcs, petsc={})
    run(case, comm, out=shared_path / "out")
    assert_certified(comm, shared_path / "out")


@pytest.mark.quick
@pytest.mark.parametrize("order", [1, 2])
def test_coated_ellipses_have_the_stiffness_of_their_mesh_solved_at_once(comm, order):
    rows = [row | {"coating": 0.1} for row in ROWS]
    cell, found = solved(comm, rows, {"young": 20.0, "poisson": 0.2}, order=order, mesh_size=0.15)
    assert relative_error(found, monolithic_stiffness(cell)) < 1e-8
