"""Meshes of Abaqus and VTK, and sides that nearly match."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.abaqus import write_inp
from unit.mesh.faulty_meshes import CURVE, RIGHT_SIDE, grid, node, turned
from unit.mesh.second_order import second_order

from feti_homog.errors import MeshError
from feti_homog.mesh.coarse_mesh import areas
from feti_homog.mesh.readers import vtk_file
from feti_homog.mesh.readers.msh_reader import read

meshio = pytest.importorskip("meshio")

BENT = second_order(grid(), lambda x, y: (0.77, 0.37) if (x, y) == (0.75, 0.375) else (x, y))
SQUARE = """*NODE
1, 0, 0
2, 1, 0
3, 1, 1
4, 0, 1
*ELEMENT, TYPE=CPS3, ELSET=matrix
1, 1, 2, 3
2, 1, 3, 4
"""


@pytest.mark.parametrize("mesh", [grid(), BENT], ids=["first", "second"])
@pytest.mark.parametrize("suffix", [".inp", ".vtu", ".vtk"])
def test_every_format_gives_the_same_mesh(suffix, mesh, tmp_path):
    mesh.write(tmp_path / "one.msh")
    expected = read(tmp_path / "one.msh")
    result = read(_written(mesh, tmp_path / f"one{suffix}"))
    assert result.phases == expected.phases and np.array_equal(result.points, expected.points)
    assert np.array_equal(_sorted(result), _sorted(expected))
    assert result.circles == pytest.approx(expected.circles) and len(result.circles) == (mesh is BENT)
    assert np.array_equal(np.sort(result.arc_edges), np.sort(expected.arc_edges))


@pytest.mark.parametrize("mesh", [grid(), BENT], ids=["first", "second"])
@pytest.mark.parametrize("suffix", [".msh", ".inp", ".vtu", ".vtk"])
def test_clockwise_elements_among_others_are_turned(suffix, mesh, tmp_path):
    expected = read(_written(mesh, tmp_path / f"one{suffix}"))
    result = read(_written(turned(mesh, 3, 11, 12, 30), tmp_path / f"other{suffix}"))
    assert np.array_equal(_sorted(result), _sorted(expected)) and np.array_equal(result.points, expected.points)
    assert areas(result.points, result.triangles) == pytest.approx(areas(expected.points, expected.triangles))
    assert np.array_equal(np.sort(result.arc_edges), np.sort(expected.arc_edges))
    assert result.circles == pytest.approx(expected.circles)


def test_sets_of_element_lines_and_of_sections_are_phases_too(tmp_path):
    expected = read(_written(grid(), tmp_path / "one.inp"))
    path = write_inp(tmp_path / "two.inp", grid(), sets=False)
    assert np.array_equal(read(path).phase, expected.phase)
    tags = sorted(tag for tag, e in grid().elements.items() if e[1] == 2)
    pairs = [f"{tag}, {tag + 1}, 1" for tag in tags[::2]]
    text = path.read_text().replace("elset=fibre", "elset=one").replace("elset=matrix", "elset=other")
    sets = ["*ELSET, ELSET=fibre, GENERATE", *pairs, "*ELSET, ELSET=matrix", "other", "*ELSET, ELSET=left", "1, 2"]
    sections = [f"*SOLID SECTION, ELSET={name}, MATERIAL=steel\n1.," for name in ("fibre", "matrix")]
    path.write_text(text.replace("*END PART\n", "\n".join([*sets, *sections, "*END PART", ""])))
    assert np.array_equal(read(path).phase, expected.phase)


@pytest.mark.parametrize("mesh", [grid(), second_order(grid())], ids=["first", "second"])
@pytest.mark.parametrize("suffix", [".inp", ".vtu", ".vtk"])
def test_debonded_lines_of_every_format_are_those_of_gmsh(suffix, mesh, tmp_path):
    raw = grid().with_curve(RIGHT_SIDE)
    raw = raw if mesh.elements == grid().elements else second_order(raw)
    expected = read(_written(raw, tmp_path / "one.msh"))
    result = read(_written(raw, tmp_path / f"one{suffix}"))
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
    result = read(_written(grid().with_curve(RIGHT_SIDE, name), tmp_path / f"one{suffix}"))
    assert len(result.debonded_edges) == 0
    assert [line.startswith(expected) for line in result.remarks] == [True]


def test_debonded_lines_may_be_the_set_of_an_element_line(tmp_path):
    path = write_inp(tmp_path / "one.inp", grid().with_curve(RIGHT_SIDE), sets=False)
    assert len(read(path).debonded_edges) == len(RIGHT_SIDE)


def test_lines_in_a_set_of_a_phase_are_not_remarked(tmp_path):
    path = write_inp(tmp_path / "one.inp", grid().with_curve(RIGHT_SIDE, "matrix"))
    assert read(path).remarks == ()


def _text(content: str) -> Callable[[Path], Path]:
    def write(path: Path) -> Path:
        path.write_text(content)
        return path

    return write


def _vtk(kinds: dict[str, list], **data: list) -> Callable[[Path], Path]:
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)

    def write(path: Path) -> Path:
        meshio.Mesh(points, list(kinds.items()), cell_data={k: [np.array(v)] for k, v in data.items()}).write(path)
        return path

    return write


HALVES = {"triangle": [[0, 1, 2], [0, 2, 3]]}
FAULTS = {
    "missing": ("a.inp", lambda path: path, "cannot be read"),
    "no triangles": ("a.inp", _text("*HEADING\nempty\n"), "no triangles in it"),
    "quadrilaterals": (
        "a.inp",
        _text(SQUARE.replace("CPS3", "CPE4")),
        "line 6, *ELEMENT: elements are CPE4: only triangles of three or six nodes",
    ),
    "no type": ("a.inp", _text(SQUARE.replace("TYPE=CPS3, ", "")), "elements are of no TYPE"),
    "short element": ("a.inp", _text(SQUARE.replace("1, 1, 2, 3", "1, 1, 2")), "element 1 has 2 nodes: expected 3"),
    "words": ("a.inp", _text(SQUARE.replace("3, 1, 1", "3, one, 1")), 'line 1, *NODE: "one": expected a number'),
    "a long word": ("a.inp", _text(SQUARE.replace("3, 1, 1", f"3, {'1' * 1000}x, 1")), "1111...: expected a number"),
    "number of a node": ("a.inp", _text(SQUARE.replace("3, 1, 1", "3.5, 1, 1")), '"3.5": expected a whole number'),
    "no numbers": ("a.inp", _text(SQUARE.replace("3, 1, 1", ", ,")), "line 1, *NODE: a line below it ends too early"),
    "short line": (
        "a.inp",
        _text(SQUARE + "*ELEMENT, TYPE=T3D2, ELSET=debonded\n7, 1\n"),
        "line 9, *ELEMENT: element 7 has 1 nodes: expected 2 or 3",
    ),
    "stray line": (
        "a.inp",
        _text(SQUARE.replace("4, 0, 1\n", "4, 0, 1\n5, 2, 2\n") + "*ELEMENT, TYPE=B21, ELSET=debonded\n7, 1, 5\n"),
        'lines in the element set "debonded" that are no edges of triangles: that between nodes 1 and 5',
    ),
    "twice": ("a.inp", _text(SQUARE + "*ELEMENT, TYPE=CPS3\n2, 1, 3, 4\n"), "element 2 is there twice"),
    "unknown node": ("a.inp", _text(SQUARE.replace("2, 1, 3, 4", "2, 1, 3, 9")), "element 2: there is no node 9"),
    "unknown set": ("a.inp", _text(SQUARE + "*ELSET, ELSET=fibre\nother\n"), 'there is no element set "other"'),
    "unknown section": ("a.inp", _text(SQUARE + "*SOLID SECTION, ELSET=steel\n"), 'element set "steel": there is none'),
    "nameless set": ("a.inp", _text(SQUARE + "*ELSET\n1\n"), "line 9, *ELSET: no ELSET"),
    "two parts": ("a.inp", _text("*PART, NAME=a\n*PART, NAME=b\n" + SQUARE), "2 parts: expected one"),
    "other files": ("a.inp", _text("*INCLUDE, INPUT=b.inp\n" + SQUARE), "other files are not read"),
    "no set": (
        "a.inp",
        _text(SQUARE.replace(", ELSET=matrix", "")),
        "element 1 at (0.666666667, 0.333333333), element 2 at (0.333333333, 0.666666667): not in any element set",
    ),
    "two sets": (
        "a.inp",
        _text(SQUARE + "*ELSET, ELSET=fibre\n1, 2\n*ELSET, ELSET=matrix\n2,\n"),
        "element 2 at (0.333333333, 0.666666667) is in 2 element sets: fibre, matrix",
    ),
    "other name": ("a.inp", _text(SQUARE.replace("matrix", "m:")), 'element set is named "matrix"'),
    "no vtk": ("a.vtu", _text("hello"), "meshio cannot read it"),
    "missing vtk": ("a.vtk", lambda path: path, "cannot be read"),
    "no phase": ("a.vtu", _vtk(HALVES, density=[1.0, 2.0]), "no cell data named phase, but density: expected 0 in"),
    "broken phase": ("a.vtu", _vtk(HALVES, phase=[0.0, 0.5]), "cell data phase = 0.5: expected 0, 1, 2, ..."),
    "quadrilateral": ("a.vtk", _vtk({"quad": [[0, 1, 2, 3]]}, phase=[0]), "elements are 1 quad: only triangles"),
    "lines only": ("a.vtu", _vtk({"line": [[0, 1]]}, phase=[0]), "no triangles in it"),
    "no matrix": ("a.vtu", _vtk(HALVES, phase=[1, 3]), 'no value of phase is named "matrix"'),
    "coarse": ("a.vtu", _vtk(HALVES, phase=[0, 0]), "no node between the corners of the left, right, lower"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_faulty_mesh_is_refused(name, tmp_path):
    file, write, message = FAULTS[name]
    with pytest.raises(MeshError) as caught:
        read(write(tmp_path / file))
    assert any(message in fault for fault in caught.value.faults), caught.value
    assert all(file in fault and "\n" not in fault for fault in caught.value.faults)


def test_without_meshio_a_line_says_what_to_install(monkeypatch, tmp_path):
    monkeypatch.setitem(vtk_file.READERS, ".vtu", "no_such_package.vtu")
    with pytest.raises(MeshError, match=r"a.vtu: .vtu files are read by meshio, .* pip install 'feti_homog\[meshes\]'"):
        read(tmp_path / "a.vtu")


@pytest.mark.parametrize("mesh", [grid(), second_order(grid())], ids=["first", "second"])
def test_sides_that_nearly_match_are_snapped(mesh, tmp_path):
    noise = np.random.default_rng(3).uniform(-4e-4, 4e-4, (5000, 2))
    nodes = {tag: (x + noise[tag, 0], y + noise[tag, 1], z) for tag, (x, y, z) in mesh.nodes.items()}
    path = _written(replace(mesh, nodes=nodes), tmp_path / "rough.msh")
    with pytest.raises(MeshError, match=r"no node at the corner|hole|straight side"):
        read(path)
    result = read(path, snap=1e-3)
    assert 4e-5 < result.snapped < 1.2e-3
    assert result.points == pytest.approx(np.array([place[:2] for place in grid().nodes.values()]), abs=2e-3)
    assert len(np.unique(result.representative)) == 16 and result.points.min() == 0.0
    for axis in (0, 1):
        low, high = (result.points[result.points[:, axis] == level] for level in (0.0, result.period[axis]))
        assert np.array_equal(low[:, 1 - axis], high[:, 1 - axis]) and len(low) == 5


def test_what_is_farther_than_the_tolerance_is_told(tmp_path):
    path = _written(grid().moved(**{f"n{node(4, 2)}": (1.0, 0.51)}), tmp_path / "rough.msh")
    with pytest.raises(MeshError, match=r"node 15 \(1, 0.51\), expected at \(0, 0.51\)"):
        read(path, snap=1e-3)
    assert read(path, snap=2e-2).snapped == pytest.approx(0.005)


def test_a_mesh_that_matches_is_not_moved(tmp_path):
    path = _written(grid(), tmp_path / "good.msh")
    assert read(path, snap=1e-2).snapped == 0.0
    assert np.array_equal(read(path, snap=1e-2).points, read(path).points)


def _written(mesh, path: Path) -> Path:
    if path.suffix == ".msh":
        mesh.write(path)
        return path
    if path.suffix == ".inp":
        return write_inp(path, mesh)
    tags, kinds = sorted(mesh.nodes), {1: "line", 8: "line3", 2: "triangle", 9: "triangle6"}
    cells, phases, debonded = [], [], []
    for kind in sorted({e[0] for e in mesh.elements.values()}):
        own = [mesh.elements[tag] for tag in sorted(mesh.elements) if mesh.elements[tag][0] == kind]
        cells.append((kinds[kind], np.searchsorted(tags, [e[3] for e in own])))
        is_line = kinds[kind].startswith("line")
        phases.append(np.array([0 if is_line else e[1] - 1 for e in own]))
        debonded.append(np.full(len(own), int(is_line and mesh.curves[CURVE] == "debonded")))
    data = {"phase": phases} | ({"debonded": debonded} if mesh.curves else {})
    meshio.Mesh(np.array([mesh.nodes[tag] for tag in tags]), cells, cell_data=data).write(path)
    return path


def _edges(mesh):
    return np.unique(np.sort(mesh.debonded_edges, axis=1), axis=0)


def _sorted(mesh):
    rows = np.column_stack([np.sort(mesh.triangles, axis=1), mesh.phase])
    return rows[np.lexsort(rows.T)]
