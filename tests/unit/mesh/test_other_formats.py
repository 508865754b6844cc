"""Meshes of Abaqus and VTK, sides that nearly match, and meshes of 6-node triangles, whose middle nodes bend edges."""

import re
from dataclasses import replace

import numpy as np
import pytest
from support.cases import case_of
from support.other_formats import written
from support.users_meshes import fibre_area, polar_cell
from unit.mesh.faulty_meshes import MATRIX, RIGHT_SIDE, MshFile, grid, node, turned
from unit.mesh.second_order import FAULTY_MIDDLES, second_order

from feti_homog.errors import MeshError
from feti_homog.mesh.coarse_mesh import areas
from feti_homog.mesh.fill import pixel_mesher
from feti_homog.mesh.mesh_fibres import fibre_circles
from feti_homog.mesh.periodic_topology import Torus
from feti_homog.mesh.readers.msh_reader import read

BENT = second_order(grid(), lambda x, y: (0.77, 0.37) if (x, y) == (0.75, 0.375) else (x, y))


@pytest.mark.parametrize("mesh", [grid(), BENT], ids=["first", "second"])
@pytest.mark.parametrize("suffix", [".inp", ".vtu", ".vtk"])
def test_every_format_gives_the_same_mesh(suffix, mesh, tmp_path):
    mesh.write(tmp_path / "one.msh")
    expected = read(tmp_path / "one.msh")
    result = read(written(mesh, tmp_path / f"one{suffix}"))
    assert result.phases == expected.phases and np.array_equal(result.points, expected.points)
    assert np.array_equal(_sorted(result), _sorted(expected))
    assert result.ellipses.circles == pytest.approx(expected.ellipses.circles)
    assert len(result.ellipses) == (mesh is BENT)
    assert np.array_equal(np.sort(result.arc_edges), np.sort(expected.arc_edges))


@pytest.mark.parametrize("mesh", [grid(), BENT], ids=["first", "second"])
@pytest.mark.parametrize("suffix", [".msh", ".inp", ".vtu", ".vtk"])
def test_clockwise_elements_among_others_are_turned(suffix, mesh, tmp_path):
    expected = read(written(mesh, tmp_path / f"one{suffix}"))
    result = read(written(turned(mesh, 3, 11, 12, 30), tmp_path / f"other{suffix}"))
    assert np.array_equal(_sorted(result), _sorted(expected)) and np.array_equal(result.points, expected.points)
    assert areas(result.points, result.triangles) == pytest.approx(areas(expected.points, expected.triangles))
    assert np.array_equal(np.sort(result.arc_edges), np.sort(expected.arc_edges))
    assert result.ellipses.circles == pytest.approx(expected.ellipses.circles)


@pytest.mark.parametrize("mesh", [grid(), second_order(grid())], ids=["first", "second"])
@pytest.mark.parametrize("suffix", [".inp", ".vtu", ".vtk"])
def test_debonded_lines_of_every_format_are_those_of_gmsh(suffix, mesh, tmp_path):
    raw = grid().with_curve(RIGHT_SIDE)
    raw = raw if mesh.elements == grid().elements else second_order(raw)
    expected = read(written(raw, tmp_path / "one.msh"))
    result = read(written(raw, tmp_path / f"one{suffix}"))
    assert np.array_equal(_edges(result), _edges(expected)) and len(_edges(result)) == len(RIGHT_SIDE)
    assert result.remarks == ()


@pytest.mark.parametrize(
    ("suffix", "name", "expected"),
    [
        (".msh", "Debonded", 'one.msh: physical curve "Debonded": not used; lines that are debonded from the start '),
        (".inp", "crack", 'one.inp: element set "crack": not used; lines that are debonded from the start belong in '),
        (".vtu", "crack", 'one.vtu: cells "line": not used; lines that are debonded from the start belong in "debonde'),
    ],
)
def test_curves_that_nothing_uses_are_remarked(suffix, name, expected, tmp_path):
    result = read(written(grid().with_curve(RIGHT_SIDE, name), tmp_path / f"one{suffix}"))
    assert len(result.debonded_edges) == 0
    assert [line.startswith(expected) for line in result.remarks] == [True]


@pytest.mark.parametrize("mesh", [grid(), second_order(grid())], ids=["first", "second"])
def test_sides_that_nearly_match_are_snapped(mesh, tmp_path):
    noise = np.random.default_rng(3).uniform(-4e-4, 4e-4, (5000, 2))
    nodes = {tag: (x + noise[tag, 0], y + noise[tag, 1], z) for tag, (x, y, z) in mesh.nodes.items()}
    path = written(replace(mesh, nodes=nodes), tmp_path / "rough.msh")
    with pytest.raises(MeshError, match=r"no node at the corner|hole|straight side"):
        read(path)
    result = read(path, snap=1e-3)
    assert 4e-5 < result.snapped < 1.2e-3
    assert result.points == pytest.approx(np.array([place[:2] for place in grid().nodes.values()]), abs=2e-3)
    assert len(np.unique(result.representative)) == 16 and result.points.min() == 0.0
    for axis in (0, 1):
        low, high = (result.points[result.points[:, axis] == level] for level in (0.0, result.period[axis]))
        assert np.array_equal(low[:, 1 - axis], high[:, 1 - axis]) and len(low) == 5


def test_what_is_farther_than_the_tolerance_is_reported(tmp_path):
    path = written(grid().moved(**{f"n{node(4, 2)}": (1.0, 0.51)}), tmp_path / "rough.msh")
    with pytest.raises(MeshError, match=r"node 15 \(1, 0.51\), expected at \(0, 0.51\)"):
        read(path, snap=1e-3)
    assert read(path, snap=2e-2).snapped == pytest.approx(0.005)


@pytest.mark.parametrize(
    ("places", "away"),
    [((1.0, 0.5003), 3e-4), ((0.9997, 0.5), 3e-4), ((1.0003, 0.5), 3e-4), ((1.0, 0.58), 0.08), ((1.0, 0.63), 0.13)],
)
def test_sides_that_nearly_match_name_the_distance_and_the_tolerance_that_snaps_them(places, away, tmp_path):
    path = written(grid().moved(**{f"n{node(4, 2)}": places}), tmp_path / "rough.msh")
    with pytest.raises(MeshError, match=f"; the nearest nodes are up to {away:g} away") as error:
        read(path)
    tolerances = re.findall('repair = "snap" in .cell. moves them, with snap_tolerance = ([0-9.e-]+)', str(error.value))
    assert (len(tolerances) > 0) == (away < 0.1)  # of edges of 0.25 a node may move by less than half of one
    assert all(away / 2 < read(path, snap=float(word)).snapped * (1 + 1e-9) <= 1.01 * away for word in tolerances)


def test_a_side_that_bends_both_ways_is_snapped_with_the_proposed_tolerance(tmp_path):
    """Two nodes lie outside the side and one inside, all at the same distance; smaller tolerances name this one."""
    moves = {node(4, 0): (1.0001, 0.0), node(4, 4): (1.0001, 1.0), node(4, 2): (0.9999, 0.5)}
    path = written(grid().moved(**{f"n{tag}": place for tag, place in moves.items()}), tmp_path / "bent.msh")
    for snap in (None, 5e-5, 9e-5):
        with pytest.raises(MeshError, match="snap_tolerance") as error:
            read(path, snap=snap)
        assert "mesh both sides" not in str(error.value)
        for word in re.findall("snap_tolerance = ([0-9.e-]+)", str(error.value)):
            assert read(path, snap=float(word)).snapped == pytest.approx(1e-4, rel=1e-3)


def test_more_nodes_on_one_side_than_on_the_other_cannot_be_snapped(tmp_path):
    mesh, (a, b, c) = grid(), grid().elements[23][3]
    mesh = replace(mesh, nodes={**mesh.nodes, 99: (1.0, 0.51, 0.0)})
    mesh = mesh.without(23).with_element(101, 2, MATRIX, (a, b, 99)).with_element(102, 2, MATRIX, (a, 99, c))
    path = written(mesh, tmp_path / "more.msh")
    with pytest.raises(MeshError, match=r"5 nodes face 6: .*; the nearest nodes are up to [0-9.]+ away$"):
        read(path)


def test_middle_nodes_off_the_sides_name_the_largest_distance_and_the_cure(tmp_path):
    away = {(0.375, 0.0): (0.375, 0.01), (0.125, 0.0): (0.125, 0.02), (0.625, 0.0): (0.625, 1e-9)}
    path = written(second_order(grid(), lambda x, y: away.get((x, y), (x, y))), tmp_path / "off.msh")
    cure = 'repair = "snap" in .cell. moves them, with snap_tolerance = 0.022$'
    with pytest.raises(MeshError, match=f"off the straight side of the cell, by up to 0.02: {cure}") as error:
        read(path)
    assert str(error.value).count("middle node") == 2
    assert read(path, snap=0.022).points == pytest.approx(read(written(grid(), tmp_path / "good.msh")).points)


def test_a_mesh_that_matches_is_not_moved(tmp_path):
    path = written(grid(), tmp_path / "good.msh")
    assert read(path, snap=1e-2).snapped == 0.0
    assert np.array_equal(read(path, snap=1e-2).points, read(path).points)


def _edges(mesh):
    return np.unique(np.sort(mesh.debonded_edges, axis=1), axis=0)


def _sorted(mesh):
    rows = np.column_stack([np.sort(mesh.triangles, axis=1), mesh.phase])
    return rows[np.lexsort(rows.T)]


def test_a_mesh_without_sides_is_refused_with_snapping_and_without(tmp_path):
    """All edges of a tetrahedron's surface lie between two triangles."""
    nodes = {1: (0.0, 0.0, 0.0), 2: (1.0, 0.0, 0.0), 3: (0.0, 1.0, 0.0), 4: (0.2, 0.3, 0.0)}
    corners = ((1, 2, 3), (1, 2, 4), (2, 3, 4), (3, 1, 4))
    MshFile(nodes, {k: (2, 1, 1, own) for k, own in enumerate(corners, start=1)}, {1: "matrix"}).write(
        tmp_path / "a.msh"
    )
    for snap in (None, 1e-3):
        with pytest.raises(MeshError):
            read(tmp_path / "a.msh", snap=snap)


@pytest.mark.parametrize("name", FAULTY_MIDDLES)
def test_faulty_middle_nodes_are_refused(name, tmp_path):
    mesh, message = FAULTY_MIDDLES[name]
    with pytest.raises(MeshError) as caught:
        read(written(mesh, tmp_path / "mesh.msh"))
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
    for mesh, expected in ((grid(), 0), (second_order(grid()), 1)):
        path = written(mesh, tmp_path / "mesh.msh")
        remarks = read(path, order=1).remarks
        assert len(remarks) == expected and all("[cell] order = 1: linear" in line for line in remarks)
        for order, some in (({}, remarks), ({"order": 2}, ())):
            case = case_of({"geometry": "mesh", "file": str(path)} | order)
            assert pixel_mesher.read_cell(case.cell).remarks == some


def test_few_edges_are_a_circle_if_their_middle_nodes_are_on_it(tmp_path):
    polar_cell((0.5, 0.5), 0.1, tmp_path / "round.msh", order=2, size=0.2)
    mesh = read(tmp_path / "round.msh")
    assert len(mesh.arc_edges) < 8 and mesh.ellipses.circles == pytest.approx(np.array([[0.5, 0.5, 0.1]]), abs=1e-8)


def test_straight_edges_stay_straight(tmp_path):
    """Corners on a circle are no circle if by the middle nodes the sides are straight."""
    ring = [(2 + 2**0.5, 2), (3, 3), (2, 2 + 2**0.5), (1, 3), (2 - 2**0.5, 2), (1, 1), (2, 2 - 2**0.5), (3, 1)]
    mesh = grid().moved(**{f"n{node(round(x), round(y))}": (x / 4, y / 4) for x, y in ring})
    assert len(read(written(mesh, tmp_path / "mesh.msh")).ellipses) == 1
    assert len(read(written(second_order(mesh), tmp_path / "mesh.msh")).ellipses) == 0


def test_bent_edges_go_through_their_middle_nodes(tmp_path):
    """A square fibre whose right side is bent outwards: three points define the arc."""
    middles = {(0.75, 0.375): (0.77, 0.37), (0.75, 0.625): (0.76, 0.63)}
    mesh = read(written(second_order(grid(), lambda x, y: middles.get((x, y), (x, y))), tmp_path / "mesh.msh"))
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
    result = read(written(mesh, tmp_path / "mesh.msh"))
    assert np.sort(result.points[result.debonded_edges[0]], axis=0).tolist() == [[0.75, 0.25], [0.75, 0.5]]
