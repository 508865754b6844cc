"""Voids that cannot be: each has one line."""

import numpy as np
import pytest
from support.generated_meshes import generate
from support.void_cells import write_part, write_voids

from feti_homog.case.cell_section import Cell
from feti_homog.errors import MeshError
from feti_homog.mesh import Torus
from feti_homog.mesh.readers.msh_reader import read


@pytest.fixture(scope="module")
def mesh():
    return generate(Cell(geometry="square", fibre_fraction=0.4, mesh_size=0.15), {})


def without(mesh, gone):
    kept = np.ones(len(mesh.triangles), bool)
    kept[gone] = False
    return kept


def faults_of(path) -> tuple[str, ...]:
    with pytest.raises(MeshError) as caught:
        read(path, has_voids=True)
    return caught.value.args


def inner_triangles(mesh):
    """Return the triangles with no node on a side of the cell."""
    inside = np.all((mesh.points > 0) & (mesh.points < mesh.period), axis=1)
    return np.flatnonzero(inside[mesh.triangles].all(axis=1))


def test_a_hole_is_a_fault_unless_the_case_has_voids(tmp_path):
    write_voids(tmp_path / "cell.msh", [0])
    with pytest.raises(MeshError) as caught:
        read(tmp_path / "cell.msh")
    (fault,) = caught.value.args
    assert fault.startswith("cell.msh: holes, 39 % of the cell, the first beside the edge between node ")
    unsaved = "gmsh saves no surface outside physical groups"
    assert fault.endswith(f": expected elements there ({unsaved}), or voids = true in [cell] if holes are voids")
    assert Torus.of(read(tmp_path / "cell.msh", has_voids=True)).voids == 1


def test_a_part_that_a_void_surrounds_is_held_by_nothing(mesh, tmp_path):
    away = np.linalg.norm(mesh.points[mesh.triangles].mean(axis=1) - 0.5, axis=1) / mesh.ellipses.circles[0, 2]
    write_part(tmp_path / "cell.msh", mesh, without(mesh, (mesh.phase == 1) & (away > 0.5)))
    (fault,) = faults_of(tmp_path / "cell.msh")
    assert fault.startswith("cell.msh: floating parts, separated from all others by voids: the part with element ")


def test_voids_do_not_touch_in_a_node(mesh, tmp_path):
    inner = inner_triangles(mesh)
    first = mesh.triangles[inner[0]]
    shared = np.isin(mesh.triangles[inner], first).sum(axis=1)
    write_part(tmp_path / "cell.msh", mesh, without(mesh, [inner[0], inner[np.argmax(shared == 1)]]))
    (fault,) = faults_of(tmp_path / "cell.msh")
    assert fault.startswith("cell.msh: voids that touch in a node, as at the edge between node ")


def test_a_void_at_a_side_is_one_at_the_opposite_side_too(mesh, tmp_path):
    at_left = np.flatnonzero((mesh.points[mesh.triangles, 0] == 0).sum(axis=1) == 2)
    middle = at_left[np.argmin(np.abs(mesh.points[mesh.triangles[at_left], 1].mean(axis=1) - 0.5))]
    write_part(tmp_path / "cell.msh", mesh, without(mesh, [middle]))
    (fault,) = faults_of(tmp_path / "cell.msh")
    assert fault.startswith(
        "cell.msh: not periodic, edges of the right side have no partner on the left side: the edge "
    )


def test_no_void_lies_over_a_corner(tmp_path):
    write_voids(tmp_path / "cell.msh", [0], geometry="hexagonal")
    assert faults_of(tmp_path / "cell.msh")[0].startswith("cell.msh: no node at the corner (0, 0)")
