"""Meshes of 6-node triangles: their middle nodes give the curves of interfaces, their corners the coarse mesh."""

import numpy as np
import pytest
from support.cases import FIBRE, MATRIX
from support.users_meshes import fibre_area, polar_cell
from unit.mesh.faulty_meshes import grid, node
from unit.mesh.second_order import FAULTY_MIDDLES, second_order

from feti_homog import Case
from feti_homog.errors import MeshError
from feti_homog.mesh.fill import pixel_mesher
from feti_homog.mesh.mesh_fibres import fibre_circles
from feti_homog.mesh.periodic_topology import Torus
from feti_homog.mesh.readers.msh_reader import read


@pytest.mark.parametrize("name", FAULTY_MIDDLES)
def test_faulty_middle_nodes_are_refused(name, tmp_path):
    mesh, message = FAULTY_MIDDLES[name]
    with pytest.raises(MeshError) as caught:
        read(_written(mesh, tmp_path))
    assert [message in fault for fault in caught.value.faults] == [True], caught.value


@pytest.mark.parametrize("centre", [(0.5, 0.5), (0.0, 0.0), (0.93, 0.08)])
def test_round_fibre_is_that_of_the_same_mesh_of_first_order(centre, tmp_path):
    for order in (1, 2):
        polar_cell(centre, 0.35, tmp_path / f"{order}.msh", order=order)
    first, second = (read(tmp_path / f"{order}.msh") for order in (1, 2))
    assert len(second.arc_edges) == len(first.arc_edges) > 0
    assert second.ellipses.circles == pytest.approx(first.ellipses.circles, abs=1e-8)
    assert len(second.points) == len(first.points) and len(second.triangles) == len(first.triangles)


@pytest.mark.parametrize(("nodes", "suffix"), [(8, ".msh"), (9, ".msh"), (8, ".vtk"), (9, ".vtk"), (8, ".inp")])
def test_quadrilaterals_of_second_order_are_round_fibres(nodes, suffix, tmp_path):
    """Their middle nodes are on the circle, and diagonals have none."""
    path = tmp_path / f"a{suffix}"
    options = {"RecombineAll": 1, "SecondOrderIncomplete": int(nodes == 8), "SaveGroupsOfElements": 1}
    polar_cell((0.5, 0.5), 0.3, path, order=2, size=0.2, **options)
    mesh = read(path, phases={"matrix": (1,), "fibre": (2,)} if suffix == ".vtk" else {})
    assert mesh.ellipses.circles == pytest.approx(np.array([[0.5, 0.5, 0.3]]), abs=1e-8)
    assert fibre_area(mesh, 2, 2) == pytest.approx(np.pi * 0.09, rel=1e-3)


def test_linear_elements_of_a_mesh_of_second_order_have_a_remark(tmp_path):
    analysis, materials = {"type": "stiffness", "plane": "strain"}, {"matrix": MATRIX, "fibre": FIBRE}
    for mesh, expected in ((grid(), 0), (second_order(grid()), 1)):
        path = _written(mesh, tmp_path)
        remarks = read(path, order=1).remarks
        assert len(remarks) == expected and all("[cell] order = 1: linear" in line for line in remarks)
        for order, some in (({}, remarks), ({"order": 2}, ())):
            cell = {"geometry": "mesh", "file": str(path)} | order
            case = Case.parse({"cell": cell, "material": materials, "analysis": analysis})
            assert pixel_mesher.read_cell(case.cell).remarks == some


def test_few_edges_are_a_circle_if_their_middle_nodes_are_on_it(tmp_path):
    polar_cell((0.5, 0.5), 0.1, tmp_path / "round.msh", order=2, size=0.2)
    mesh = read(tmp_path / "round.msh")
    assert len(mesh.arc_edges) < 8 and mesh.ellipses.circles == pytest.approx(np.array([[0.5, 0.5, 0.1]]), abs=1e-8)


def test_straight_edges_stay_straight(tmp_path):
    """Corners on a circle are no circle if by the middle nodes the sides are straight."""
    ring = [(2 + 2**0.5, 2), (3, 3), (2, 2 + 2**0.5), (1, 3), (2 - 2**0.5, 2), (1, 1), (2, 2 - 2**0.5), (3, 1)]
    mesh = grid().moved(**{f"n{node(round(x), round(y))}": (x / 4, y / 4) for x, y in ring})
    assert len(read(_written(mesh, tmp_path)).ellipses) == 1
    assert len(read(_written(second_order(mesh), tmp_path)).ellipses) == 0


def test_bent_edges_go_through_their_middle_nodes(tmp_path):
    """A square fibre whose right side is bent outwards: three points define the arc."""
    middles = {(0.75, 0.375): (0.77, 0.37), (0.75, 0.625): (0.76, 0.63)}
    mesh = read(_written(second_order(grid(), lambda x, y: middles.get((x, y), (x, y))), tmp_path))
    assert len(mesh.arc_edges) == 2 and np.isnan(fibre_circles(Torus.of(mesh))[1, 2])
    for edge, circle in zip(mesh.arc_edges, mesh.ellipses.circles, strict=True):
        ends = mesh.points[edge]
        on_arc = np.array([*ends, middles[tuple(ends.mean(axis=0).tolist())]])
        assert np.linalg.norm(on_arc - circle[:2], axis=1) == pytest.approx(np.full(3, circle[2]), rel=1e-12)


def test_debonded_lines_of_second_order(tmp_path):
    mesh = second_order(grid())
    line = (node(3, 1), node(3, 2))
    middle = next(tag for tag, place in mesh.nodes.items() if place == (0.75, 0.375, 0.0))
    mesh = mesh.with_curve([line])
    mesh = mesh.with_element(900, 8, 7, (*line, middle))
    result = read(_written(mesh, tmp_path))
    assert np.sort(result.points[result.debonded_edges[0]], axis=0).tolist() == [[0.75, 0.25], [0.75, 0.5]]


def _written(mesh, folder):
    mesh.write(folder / "mesh.msh")
    return folder / "mesh.msh"
