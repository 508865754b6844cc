"""Meshes of Abaqus and VTK, and sides that nearly match."""

import re
from dataclasses import replace

import numpy as np
import pytest
from support.other_formats import written
from unit.mesh.faulty_meshes import MATRIX, RIGHT_SIDE, MshFile, grid, node, turned
from unit.mesh.second_order import second_order

from feti_homog.errors import MeshError
from feti_homog.mesh.coarse_mesh import areas
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
