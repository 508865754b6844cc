"""Meshes of users, whose fibres are not round, from the file to results that obey every law."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.abaqus import write_inp
from support.cases import MATRIX, case_of
from support.ranks import assert_certified, parallel_assert
from support.users_meshes import polar_cell
from unit.mesh.faulty_meshes import grid

from feti_homog import Case, run
from feti_homog.mesh.readers.msh_reader import read

pytestmark = [pytest.mark.parallel, pytest.mark.few_ranks]


def meshed(mesh: Path, order: int, **sections: Any) -> Case:
    return case_of({"geometry": "mesh", "file": str(mesh), "order": order, "refine": 1}, **sections)


@pytest.mark.one_rank
@pytest.mark.parametrize("mesh_order", [1, 2])
def test_few_ellipses_have_the_stiffness_of_eshelby(comm: Any, shared_path: Path, mesh_order: int) -> None:
    """The dilute solution with the matrix's mean strain around (Mori and Tanaka); images err by their fraction f."""
    mesh, (a, b) = shared_path / "dilute.msh", (0.08, 0.04)
    if comm.rank == 0:
        polar_cell((0.5, 0.5), b, mesh, stretch=a / b, order=mesh_order, size=0.025)
    comm.barrier()
    stiff = {"young": 2000.0, "poisson": 0.222}
    result = run(meshed(mesh, 2, material={"matrix": MATRIX, "fibre": stiff}), comm)
    L, Lf = (plane_strain(**constants) for constants in (MATRIX, stiff))
    A = np.linalg.inv(np.eye(3) + eshelby(a, b, MATRIX["poisson"]) @ np.linalg.solve(L, Lf - L))
    f = np.pi * a * b
    raised = f * (Lf - L) @ A @ np.linalg.inv((1 - f) * np.eye(3) + f * A)
    difference = np.abs(np.asarray(result.effective_stiffness) - L - raised).max() / np.abs(raised).max()
    parallel_assert(comm, difference < f, f"{difference}")


def plane_strain(young: float, poisson: float) -> np.ndarray:
    """(3, 3) in the order [11, 22, 12] with engineering shear."""
    mu = young / (2 * (1 + poisson))
    lam = 2 * mu * poisson / (1 - 2 * poisson)
    return np.diag([2 * mu, 2 * mu, mu]) + lam * np.outer([1, 1, 0], [1, 1, 0])


def eshelby(a: float, b: float, nu: float) -> np.ndarray:
    """(3, 3) Eshelby's tensor of an elliptic cylinder in the plane.

    Mura, Micromechanics of defects in solids (1987), Eq. (11.22).
    """
    s, k = a + b, 1 - 2 * nu
    tensor = [
        [(b * b + 2 * a * b) / s**2 + k * b / s, b * b / s**2 - k * b / s, 0],
        [a * a / s**2 - k * a / s, (a * a + 2 * a * b) / s**2 + k * a / s, 0],
        [0, 0, (a * a + b * b) / s**2 + k],
    ]
    return np.array(tensor) / (2 * (1 - nu))


@pytest.mark.parametrize(("order", "mesh_order"), [(1, 2), (2, 1)])
def test_debonded_ellipse_obeys_every_law(comm: Any, shared_path: Path, order: int, mesh_order: int) -> None:
    """With elements of either order on a mesh of either."""
    mesh = shared_path / "ellipse.msh"
    if comm.rank == 0:
        polar_cell((0.5, 0.5), 0.2, mesh, stretch=1.5, order=mesh_order, size=0.1, turn=0.3)
    comm.barrier()
    case = meshed(mesh, order, interface={"debonded": [{"fibre": 1, "centre": 20.0, "angle": 110.0}]})
    run(case, comm, out=shared_path / "out")
    assert_certified(comm, shared_path / "out")


def test_the_result_says_how_far_nodes_were_snapped(comm: Any, shared_path: Path) -> None:
    """And has the stiffness of the mesh that matches, but for what they were moved."""
    rough, good = shared_path / "rough.inp", shared_path / "good.inp"
    if comm.rank == 0:
        write_inp(good, grid())
        write_inp(rough, grid().moved(n15=(1.0004, 0.5), n10=(1.0, 0.2503)))
    comm.barrier()
    cell = {"geometry": "mesh", "file": str(rough), "repair": "snap"}
    result = run(case_of(cell), comm)
    expected = run(case_of(cell | {"file": str(good)}), comm)
    warned = [warning for warning in result.warnings if "were moved by up to 0.0004 to match" in warning]
    stiffness, exact = (np.asarray(r.effective_stiffness) for r in (result, expected))
    difference = np.abs(stiffness - exact).max() / exact.max()
    parallel_assert(comm, len(warned) == 1 and not expected.warnings and difference < 1e-3, f"{warned}, {difference}")


def test_turned_mesh_has_the_turned_stiffness(comm: Any, shared_path: Path) -> None:
    """A turn by a right angle exchanges E11 and E22 and changes the signs of the couplings with the shear."""
    meshio = pytest.importorskip("meshio")
    one, two = shared_path / "one.msh", shared_path / "two.vtu"
    if comm.rank == 0:
        polar_cell((0.5, 0.5), 0.2, one, stretch=1.5, turn=0.3)
        mesh = read(one)
        turned = np.column_stack([-mesh.points[:, 1], mesh.points[:, 0], np.zeros(len(mesh.points))])
        meshio.Mesh(turned, [("triangle", mesh.triangles)], cell_data={"phase": [mesh.phase]}).write(two)
    comm.barrier()
    first, second = (np.asarray(run(meshed(mesh, 2), comm).effective_stiffness) for mesh in (one, two))
    swap = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1]])
    difference = np.abs(swap @ first @ swap - second).max() / np.abs(first).max()
    coupled = np.abs(first[2, :2]).max() / np.abs(first).max()
    parallel_assert(comm, difference < 1e-9 < 1e-4 < coupled, f"{difference}, {coupled}")
