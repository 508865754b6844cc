"""A user's mesh: faults are named, good meshes come back as they are, and [cell.phases] selects their groups."""

import re
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.users_meshes import polar_cell
from unit.mesh.faulty_meshes import FAULTY_MESHES, grid, write_faulty

from feti_homog.errors import MeshError
from feti_homog.mesh.coarse_mesh import CoarseMesh, areas
from feti_homog.mesh.readers.msh_reader import read

MESHES = Path(__file__).parents[4] / "meshes"


@pytest.mark.parametrize(("message", "mesh"), FAULTY_MESHES, ids=[words for words, _ in FAULTY_MESHES])
def test_faulty_mesh_is_refused(message, mesh, tmp_path):
    write_faulty(mesh, tmp_path / "faulty.msh")
    with pytest.raises(MeshError) as caught:
        read(tmp_path / "faulty.msh")
    assert any(message in fault for fault in caught.value.faults), caught.value
    assert all("faulty.msh" in fault and "\n" not in fault for fault in caught.value.faults)


def test_several_faults_are_reported_at_once(tmp_path):
    mesh = replace(grid(), names={1: "my resin", 2: "my fibre"}).with_element(5, 2, 0, (3, 4, 9))
    assert len(mesh.faults(tmp_path)) == 4


def test_faults_after_the_first_few_are_counted(tmp_path):
    mesh = grid()
    for tag in (1, 3, 5, 7, 9):
        mesh = mesh.with_element(tag, 2, 0, mesh.elements[tag][3])
    (fault,) = mesh.faults(tmp_path)
    assert fault.endswith("element 5 at (0.666666667, 0.0833333333) and 2 more: not in any physical surface")


def test_grid_comes_back(tmp_path):
    grid().write(tmp_path / "good.msh")
    mesh = read(tmp_path / "good.msh")
    assert (mesh.width, mesh.height, mesh.phases) == (1.0, 1.0, ("matrix", "fibre"))
    assert len(mesh.points) == 25 and len(mesh.triangles) == 32 and len(mesh.ellipses) == 0
    assert areas(mesh.points, mesh.triangles) == pytest.approx(np.full(32, 1 / 32))
    assert np.bincount(mesh.phase).tolist() == [24, 8]
    assert len(np.unique(mesh.representative)) == 16


def test_clockwise_and_shifted_mesh_is_turned_and_moved(tmp_path):
    mesh = grid()
    nodes = {tag: (3 * x - 5, 2 * y + 7, 4.0) for tag, (x, y, _) in mesh.nodes.items()}
    elements = {tag: (*e[:3], e[3][::-1]) for tag, e in mesh.elements.items()}
    replace(mesh, nodes=nodes, elements=elements).write(tmp_path / "good.msh")
    result = read(tmp_path / "good.msh")
    assert (result.width, result.height) == (3.0, 2.0)
    assert np.all(result.points.min(axis=0) == 0) and areas(result.points, result.triangles).min() > 0


def test_unused_nodes_are_ignored(tmp_path):
    mesh = grid()
    replace(mesh, nodes={**mesh.nodes, 500: (9.0, 9.0, 9.0)}).write(tmp_path / "good.msh")
    assert len(read(tmp_path / "good.msh").points) == 25


def test_rounded_coordinates_are_matched_exactly(tmp_path):
    noise = np.random.default_rng(1).uniform(-2e-8, 2e-8, (26, 2))
    nodes = {tag: (x + noise[tag, 0], y + noise[tag, 1], z) for tag, (x, y, z) in grid().nodes.items()}
    replace(grid(), nodes=nodes).write(tmp_path / "good.msh")
    _assert_periodic(read(tmp_path / "good.msh"))


def test_phases_beyond_two_and_matrix_first(tmp_path):
    mesh = grid(lambda x, y: y > 0.5)
    mesh = replace(mesh, names={1: "fibre:glass", 2: "matrix"})
    mesh.write(tmp_path / "good.msh")
    result = read(tmp_path / "good.msh")
    assert result.phases == ("matrix", "fibre:glass") and len(result.ellipses) == 0
    upper = result.points[result.triangles].mean(axis=1)[:, 1] > 0.5
    assert np.array_equal(result.phase, np.where(upper, 0, 1))


@pytest.mark.parametrize("corner", [False, True])
def test_polygons_stay_polygons(corner, tmp_path):
    """A square fibre, in the middle or around the corner: its corners are on a circle, its sides are not."""
    inside = (lambda x, y: abs(x - 0.5) > 0.25 and abs(y - 0.5) > 0.25) if corner else None
    (grid(inside) if inside else grid()).write(tmp_path / "good.msh")
    mesh = read(tmp_path / "good.msh")
    assert len(mesh.ellipses) == 0 and len(mesh.arc_edges) == 0 and np.bincount(mesh.phase)[1] == 8


@pytest.mark.parametrize("centre", [(0.5, 0.5), (0.0, 0.0), (0.1, 0.45), (0.93, 0.08)])
def test_round_fibre_is_found_wherever_the_cell_cuts_it(centre, tmp_path):
    polar_cell(centre, 0.35, tmp_path / "round.msh")
    mesh = read(tmp_path / "round.msh")
    _assert_periodic(mesh)
    size = np.array([mesh.width, mesh.height])
    offset = (mesh.ellipses.circles[:, :2] - centre + size / 2) % size - size / 2
    assert np.abs(offset).max() < 1e-8 and mesh.ellipses.circles[:, 2] == pytest.approx(0.35, abs=1e-8)
    spokes = mesh.points[mesh.arc_edges] - mesh.ellipses.circles[mesh.arc_circle][:, None, :2]
    radius = mesh.ellipses.circles[mesh.arc_circle][:, None, 2]
    assert np.abs(np.linalg.norm(spokes, axis=2) / radius - 1).max() < 1e-12
    turned = np.arctan2(*np.moveaxis(spokes, 2, 0)[::-1])
    spans = np.abs((turned[:, 1] - turned[:, 0] + np.pi) % (2 * np.pi) - np.pi)
    assert spans.sum() == pytest.approx(2 * np.pi)


def test_an_ellipse_is_no_circle(tmp_path):
    polar_cell((0.5, 0.5), 0.35, tmp_path / "round.msh", stretch=1 + 1e-5)
    mesh = read(tmp_path / "round.msh")
    assert len(mesh.ellipses) == 1 and np.isnan(mesh.ellipses.circles[0, 2])
    semi_axes = np.linalg.svd(mesh.ellipses.frames[0], compute_uv=False)
    assert semi_axes == pytest.approx([0.35 * (1 + 1e-5), 0.35], rel=1e-9)


@pytest.mark.parametrize(("name", "height", "circles"), [("square", 1.0, 1), ("hexagonal", np.sqrt(3), 5)])
def test_meshes_of_the_repository_have_their_circles_and_fraction(name, height, circles):
    mesh = read(MESHES / f"{name}.msh")
    assert (mesh.width, mesh.height) == pytest.approx((1.0, height)) and len(mesh.ellipses) == circles
    _assert_periodic(mesh)
    fibres = 1 if name == "square" else 2
    assert fibres * np.pi * mesh.ellipses.circles[0, 2] ** 2 / height == pytest.approx(0.4, abs=1e-6)


def _assert_periodic(mesh: CoarseMesh) -> None:
    size = np.array([mesh.width, mesh.height])
    shift = mesh.points - mesh.points[mesh.representative]
    assert np.all((shift == 0) | (shift == size))
    assert np.all(mesh.points[mesh.representative] < size)
    assert np.array_equal(mesh.representative[mesh.representative], mesh.representative)
    assert areas(mesh.points, mesh.triangles).min() > 0


NAMES = {1: "Epoxy resin", 2: "E-Glass"}


@pytest.mark.parametrize(
    ("names", "phases", "materials", "proposed"),
    [
        ({1: "resin", 2: "glas fibre"}, {"matrix": ("resin",)}, (), 'set in [cell]: phases = {matrix = "resin", fibre'),
        ({1: "resin", 2: "glass"}, {}, ("matrix", "glass"), 'add to [cell]: phases = {matrix = "resin"}.'),
        ({1: "resin", 2: "E 1"}, {}, ("matrix", "glass"), 'phases = {matrix = "resin", glass = "E 1"}.'),
        ({1: "matrix", 2: "E 1"}, {}, (), 'are fibres, add to [cell]: phases = {fibre = "E 1"}.'),
        ({1: "fibre", 2: "resin"}, {}, (), 'add to [cell]: phases = {matrix = "resin"}. Shares'),
        ({1: "Fibers", 2: "resin"}, {}, (), 'add to [cell]: phases = {matrix = "resin", fibre = "Fibers"}. Shares'),
        ({1: "fibre:2", 2: "resin"}, {}, (), 'add to [cell]: phases = {matrix = "resin"}. Shares'),
    ],
)
def test_phases_that_are_proposed_read_the_mesh(tmp_path, names, phases, materials, proposed):
    """Fibres are not the matrix, even if they are the largest group."""
    fault = replace(grid(), names=names).faults(tmp_path, phases=phases, materials=materials)[-1]
    assert proposed in fault and all(f'"{name}"' in fault.partition("the file has")[2] for name in names.values())
    entries = tomllib.loads(re.search(r"phases = \{.*?\}", fault)[0])["phases"]
    read(tmp_path / "faulty.msh", phases={name: (group,) for name, group in entries.items()})


@pytest.mark.parametrize(
    ("names", "phases", "fault"),
    [
        ({}, {"matrix": (1,), "glass": (2,), "carbon": (2,)}, "carbon = 2: also in glass; expected each group in one"),
        (NAMES, {"matrix": (1,), "a": ("E-Glass",), "b": ("e-glass",)}, 'b = "e-glass": also in a; expected each'),
        (NAMES, {"matrix": (1,), "a": ("E-Glass",), "b": (2,)}, "is in 2 physical surfaces: a, b; [cell.phases] names"),
    ],
)
def test_a_group_in_two_phases_is_refused(tmp_path, names, phases, fault):
    assert any(fault in line for line in replace(grid(), names=names).faults(tmp_path, phases=phases))


@pytest.mark.parametrize(
    ("names", "proposed"),
    [
        ({1: "Fibre", 2: "Interphase", 3: "Matrix"}, '{matrix = "Matrix", fibre = "Fibre", coating = "Interphase"}'),
        ({1: "1", 2: "2", 3: "3"}, '{matrix = "1", fibre = "3", coating = "2"}'),
        ({1: "Coating", 2: "MATRIX", 3: "glass"}, '{matrix = "MATRIX", coating = "Coating", fibre = "glass"}'),
    ],
)
def test_proposals_follow_the_materials_whatever_the_capitals(tmp_path, names, proposed):
    """Of 50 %, 12.5 % and 37.5 % of the area: alike names belong together, and a coating is the smallest."""
    elements = {}
    for tag, (kind, _, _, nodes) in grid().elements.items():
        number = 1 if tag <= 16 else 2 if tag <= 20 else 3
        elements[tag] = (kind, number, number, nodes)
    mesh = replace(grid(), elements=elements, names=names)
    fault = mesh.faults(tmp_path, materials=("matrix", "coating", "fibre"))[-1]
    assert f"add to [cell]: phases = {proposed}. Shares" in fault
