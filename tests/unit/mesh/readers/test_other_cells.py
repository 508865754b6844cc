"""Cells that are no rectangle, or have a hole at a corner: messages name the remedy."""

from dataclasses import replace

import numpy as np
import pytest
from unit.mesh.faulty_meshes import MATRIX, MshFile, grid
from unit.mesh.test_void_faults import faults_of, write_voids

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
    "turned": (mapped([[0.8, -0.6], [0.6, 0.8]]), "parallelogram"),
    "hexagon": (hexagon(), "hexagon"),
    "hexagon, upright": (hexagon(np.pi / 2), "hexagon"),
}


@pytest.mark.parametrize("name", CELLS)
def test_another_cell_leads_to_the_recipe(tmp_path, name):
    mesh, kind = CELLS[name]
    mesh.write(tmp_path / "cell.msh")
    (fault,) = faults_of(tmp_path / "cell.msh")
    assert fault.startswith(f"cell.msh: the cell is a {kind}, expected a rectangle: see ")


def test_a_hole_at_a_corner_leads_to_a_shift(tmp_path):
    write_voids(tmp_path / "cell.msh", [0], geometry="hexagonal")
    fault = faults_of(tmp_path / "cell.msh")[0]
    assert fault.endswith("if a hole is there, shift the fibres until the corners lie in material")
