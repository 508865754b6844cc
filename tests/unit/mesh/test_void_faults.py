"""Voids and cells that cannot be: each has one line, which names the remedy."""

from dataclasses import replace

import numpy as np
import pytest
from support.generated_meshes import generate
from support.void_cells import write_part, write_voids
from unit.mesh.faulty_meshes import MATRIX, MshFile, grid

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


def test_a_void_over_a_corner_leads_to_a_shift(tmp_path):
    write_voids(tmp_path / "cell.msh", [0], geometry="hexagonal")
    fault = faults_of(tmp_path / "cell.msh")[0]
    assert fault.startswith("cell.msh: no node at the corner (0, 0)")
    assert fault.endswith("if a hole is there, shift the fibres until the corners lie in material")


ROOT = np.sqrt(3.0)
HEXAGON = [(np.cos(np.pi * k / 3), np.sin(np.pi * k / 3)) for k in range(6)]


def mapped(matrix):
    """Return the grid under a linear map."""
    nodes = {tag: (*(np.array(matrix) @ place[:2]).tolist(), 0.0) for tag, place in grid().nodes.items()}
    return replace(grid(), nodes=nodes)


def hexagon(turn=0.0):
    """Return a regular hexagon of side 1 in triangles about its centre."""
    c, s = np.cos(turn), np.sin(turn)
    nodes = {k + 1: (c * x - s * y, s * x + c * y, 0.0) for k, (x, y) in enumerate([*HEXAGON, (0.0, 0.0)])}
    elements = {k + 1: (2, MATRIX, MATRIX, (k + 1, (k + 1) % 6 + 1, 7)) for k in range(6)}
    return MshFile(nodes, elements)


CELLS = {
    "rhombus": (mapped([[1, 0.5], [0, ROOT / 2]]), "parallelogram"),
    "rhombus on its tip": (mapped([[0.5, -0.5], [0.75, 0.75]]), "parallelogram"),
    "sheared by any number": (mapped([[1, 0.2345678], [0, 0.9]]), "parallelogram"),
    "turned": (mapped([[0.8, -0.6], [0.6, 0.8]]), "rectangle turned by 36.9 degrees"),
    "hexagon": (hexagon(), "hexagon"),
    "hexagon, upright": (hexagon(np.pi / 2), "hexagon"),
}


@pytest.mark.parametrize("name", CELLS)
def test_another_cell_leads_to_the_recipe(tmp_path, name):
    mesh, kind = CELLS[name]
    mesh.write(tmp_path / "cell.msh")
    (fault,) = faults_of(tmp_path / "cell.msh")
    assert fault.startswith(f"cell.msh: the cell is a {kind}, expected a rectangle: see ")
