"""Meshes of Abaqus and VTK, and sides that nearly match."""

from __future__ import annotations

import base64
import lzma
import zlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.other_formats import written
from unit.mesh.faulty_meshes import RIGHT_SIDE, grid, node, turned
from unit.mesh.second_order import second_order

from feti_homog.errors import MeshError
from feti_homog.mesh.coarse_mesh import areas
from feti_homog.mesh.readers import vtk_file
from feti_homog.mesh.readers.msh_reader import read

meshio = pytest.importorskip("meshio")

BENT = second_order(grid(), lambda x, y: (0.77, 0.37) if (x, y) == (0.75, 0.375) else (x, y))


@pytest.mark.parametrize("mesh", [grid(), BENT], ids=["first", "second"])
@pytest.mark.parametrize("suffix", [".inp", ".vtu", ".vtk"])
def test_every_format_gives_the_same_mesh(suffix, mesh, tmp_path):
    mesh.write(tmp_path / "one.msh")
    expected = read(tmp_path / "one.msh")
    result = read(written(mesh, tmp_path / f"one{suffix}"))
    assert result.phases == expected.phases and np.array_equal(result.points, expected.points)
    assert np.array_equal(_sorted(result), _sorted(expected))
    assert result.circles == pytest.approx(expected.circles) and len(result.circles) == (mesh is BENT)
    assert np.array_equal(np.sort(result.arc_edges), np.sort(expected.arc_edges))


@pytest.mark.parametrize("mesh", [grid(), BENT], ids=["first", "second"])
@pytest.mark.parametrize("suffix", [".msh", ".inp", ".vtu", ".vtk"])
def test_clockwise_elements_among_others_are_turned(suffix, mesh, tmp_path):
    expected = read(written(mesh, tmp_path / f"one{suffix}"))
    result = read(written(turned(mesh, 3, 11, 12, 30), tmp_path / f"other{suffix}"))
    assert np.array_equal(_sorted(result), _sorted(expected)) and np.array_equal(result.points, expected.points)
    assert areas(result.points, result.triangles) == pytest.approx(areas(expected.points, expected.triangles))
    assert np.array_equal(np.sort(result.arc_edges), np.sort(expected.arc_edges))
    assert result.circles == pytest.approx(expected.circles)


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


def _text(content: str) -> Callable[[Path], Path]:
    def write(path: Path) -> Path:
        path.write_text(content)
        return path

    return write


SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
HALVES = {"triangle": [[0, 1, 2], [0, 2, 3]]}


def _vtk(kinds: dict[str, list], **data: list) -> Callable[[Path], Path]:
    def write(path: Path) -> Path:
        meshio.Mesh(SQUARE, list(kinds.items()), cell_data={k: [np.array(v)] for k, v in data.items()}).write(path)
        return path

    return write


def _changed(suffix: str, old: str, new: str, **options) -> Callable[[Path], Path]:
    """Write the halves of a square with some other text in it."""

    def write(path: Path) -> Path:
        meshio.Mesh(SQUARE, [("triangle", HALVES["triangle"])], cell_data={"phase": [np.array([0, 0])]}).write(
            path, **options
        )
        content = path.read_bytes()
        assert old.encode() in content
        path.write_bytes(content.replace(old.encode(), new.encode(), 1))
        return path

    return write


def _packed(bytes_: int, compressor: str) -> Callable[[Path], Path]:
    """Write the phases of a square as so many compressed zeros."""
    pack = {"vtkZLibDataCompressor": zlib.compress, "vtkLZMADataCompressor": lzma.compress}[compressor]

    def write(path: Path) -> Path:
        block = pack(bytes(bytes_))
        words = [np.array(part, "<u4").tobytes() for part in ([1, 2**31, 0, len(block)],)]
        text = (base64.b64encode(words[0]) + base64.b64encode(block)).decode()
        array = f'<DataArray type="Int8" Name="phase" format="binary">{text}</DataArray>'
        path.write_text(
            f'<VTKFile type="UnstructuredGrid" byte_order="LittleEndian" compressor="{compressor}"><UnstructuredGrid>'
            f'<Piece NumberOfPoints="0" NumberOfCells="0"><CellData>{array}</CellData></Piece>'
            "</UnstructuredGrid></VTKFile>"
        )
        return path

    return write


TEXT = {"binary": False}
FAULTS = {
    "no vtk": ("a.vtu", _text("hello"), "not XML: syntax error: line 1, column 0"),
    "missing vtk": ("a.vtk", lambda path: path, "cannot be read"),
    "no phase": ("a.vtu", _vtk(HALVES, density=[1.0, 2.0]), "no cell data named phase, but density: expected 0 in"),
    **{
        f"phase {value:g}": (
            "a.vtu",
            _vtk(HALVES, phase=[0.0, value]),
            f"cell data phase = {value:g}: expected 0, 1, 2",
        )
        for value in (-1.0, 1e18, 1e30, float("inf"), float("nan"))
    },
    "node beyond the last": (
        "a.vtu",
        _vtk({"triangle": [[0, 1, 9]]}, phase=[0]),
        "a triangle has the node 9: expected 0 to 3",
    ),
    "negative node": (
        "a.vtk",
        _vtk({"triangle": [[0, 1, -1]]}, phase=[0]),
        "a triangle has the node -1: expected 0 to 3",
    ),
    "phases of two components": (
        "a.vtu",
        _vtk(HALVES, phase=[[0, 0], [0, 0]]),
        "cell data phase: expected one value for",
    ),
    "line of the fault": (
        "a.vtu",
        _changed(".vtu", "</Piece>", "</Peace>", **TEXT),
        "not XML: mismatched tag: line 51, column 2",
    ),
    "type of the header": (
        "a.vtu",
        _changed(".vtu", "<VTKFile ", '<VTKFile header_type="Int64" '),
        'header_type is "Int64": expected UInt32 or UInt64',
    ),
    "polyhedra": ("a.vtu", _changed(".vtu", 'Name="phase"', 'Name="faces"', **TEXT), "elements are polyhedra: only"),
    "words": (
        "a.vtu",
        _changed(".vtu", "0\n1\n2\n", "0\none\n2\n", **TEXT),
        "meshio cannot read it: string or file could",
    ),
    "points": (
        "a.vtk",
        _changed(".vtk", "POINTS 4 ", "POINTS 99999999999 "),
        "it declares POINTS of 99999999999 values",
    ),
    "cells": (
        "a.vtk",
        _changed(".vtk", "CELLS 3 6", "CELLS 3 1000000000000"),
        "it declares CELLS of 1000000000000 values",
    ),
    "fields": (
        "a.vtk",
        _changed(".vtk", "phase 1 2 vtktypeint64", "phase 1000000 1000000 vtktypeint64"),
        "it declares an array of 1000000000000 values",
    ),
    "structured": (
        "a.vtk",
        _text("# vtk DataFile Version 4.2\na\nASCII\nDATASET STRUCTURED_POINTS\nDIMENSIONS 9999999 9999999 1\n"),
        "DATASET STRUCTURED_POINTS: expected UNSTRUCTURED_GRID",
    ),
    "much from little": (
        "a.vtu",
        _packed(2**27, "vtkZLibDataCompressor"),
        "its compressed data are too large for a file",
    ),
    "much by lzma": ("a.vtu", _packed(2**27, "vtkLZMADataCompressor"), "its compressed data are too large for a file"),
    "broken phase": ("a.vtu", _vtk(HALVES, phase=[0.0, 0.5]), "cell data phase = 0.5: expected 0, 1, 2, ..."),
    "tetrahedron": ("a.vtk", _vtk({"tetra": [[0, 1, 2, 3]]}, phase=[0]), "elements are 1 tetra: only triangles"),
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


def test_a_mesh_that_matches_is_not_moved(tmp_path):
    path = written(grid(), tmp_path / "good.msh")
    assert read(path, snap=1e-2).snapped == 0.0
    assert np.array_equal(read(path, snap=1e-2).points, read(path).points)


def _edges(mesh):
    return np.unique(np.sort(mesh.debonded_edges, axis=1), axis=0)


def _sorted(mesh):
    rows = np.column_stack([np.sort(mesh.triangles, axis=1), mesh.phase])
    return rows[np.lexsort(rows.T)]
