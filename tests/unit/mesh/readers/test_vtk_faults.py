"""Faulty and hostile files of VTK and Medit: each has its line."""

import base64
import lzma
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from feti_homog.errors import MeshError
from feti_homog.mesh.readers.msh_reader import read

meshio = pytest.importorskip("meshio")


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
            f'<Piece NumberOfPoints="0" NumberOfCells="0"><Points/><Cells/><CellData>{array}</CellData></Piece>'
            "</UnstructuredGrid></VTKFile>"
        )
        return path

    return write


TEXT = {"binary": False}
MEDIT = """MeshVersionFormatted 2
Dimension 2
Vertices 4
0 0 0  1 0 0  1 1 0  0 1 0
Triangles 2
1 2 3 1
1 3 4 1
Ridges 0
End
"""
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
        "cell 0 has the node 9: expected 0 to 3",
    ),
    "negative node": (
        "a.vtk",
        _vtk({"triangle": [[0, 1, -1]]}, phase=[0]),
        "cell 0 has the node -1: expected 0 to 3",
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
    "polyhedra": (
        "a.vtu",
        _changed(".vtu", "5\n5\n", "42\n5\n", **TEXT),
        "1 cells are polyhedra, the first is number 0: only triangles of three or six nodes and quadrilaterals",
    ),
    "polygon": (
        "a.vtu",
        _changed(".vtu", "3\n6\n", "1\n6\n", **TEXT),
        "cell 0, of type 5, has 1 nodes: expected 3",
    ),
    "offset beyond the nodes": (
        "a.vtu",
        _changed(".vtu", "3\n6\n", "3\n1000000000\n", **TEXT),
        "the cells and their nodes do not belong together: the file is damaged",
    ),
    "words": (
        "a.vtu",
        _changed(".vtu", "0\n1\n2\n", "0\none\n2\n", **TEXT),
        'array "connectivity": "one": expected a whole number',
    ),
    "lz4": (
        "a.vtu",
        _changed(".vtu", "vtkZLibDataCompressor", "vtkLZ4DataCompressor"),
        'compressor is "vtkLZ4DataCompressor": expected vtkZLibDataCompressor or vtkLZMADataCompressor',
    ),
    "surfaces": (
        "a.vtu",
        _text('<VTKFile type="PolyData"><PolyData><Piece NumberOfPoints="0"/></PolyData></VTKFile>'),
        "<PolyData> in <VTKFile>: expected UnstructuredGrid and AppendedData",
    ),
    "part of a piece": (
        "a.vtu",
        _changed(".vtu", "<CellData>", "<Polys></Polys><CellData>", **TEXT),
        "<Polys> in <Piece>: expected Points and Cells and CellData and PointData",
    ),
    "fewer cells than arrays have": (
        "a.vtu",
        _changed(".vtu", 'NumberOfCells="2"', 'NumberOfCells="1"'),
        "2 types of cells: expected 1",
    ),
    "points": (
        "a.vtk",
        _changed(".vtk", "POINTS 4 ", "POINTS 99999999999 "),
        "299999999997 values should follow, and",
    ),
    "cells": (
        "a.vtk",
        _changed(".vtk", "CELLS 3 6", "CELLS 3 1000000000000"),
        "1000000000000 values should follow, and",
    ),
    "fields": (
        "a.vtk",
        _changed(".vtk", "phase 1 2 vtktypeint64", "phase 1000000 1000000 vtktypeint64"),
        "1000000000000 values should follow, and",
    ),
    "cells of two files": (
        "a.vtk",
        _changed(".vtk", "CELL_DATA 2", "CELL_TYPES 2\n5\n5\nCELL_DATA 2", **TEXT),
        "line 22: CELL_TYPES: it is there twice",
    ),
    "unknown section": (
        "a.vtk",
        _changed(".vtk", "CELL_DATA 2", "POLYGONS 1 4\n3 0 1 2\nCELL_DATA 2", **TEXT),
        'line 22: "POLYGONS": expected DATASET, POINTS, CELLS',
    ),
    "triangle strips": (
        "a.vtk",
        _changed(".vtk", "5\n5\n", "6\n5\n", **TEXT),
        "1 cells are triangle strips, the first is number 0: only triangles",
    ),
    "no medit": ("a.mesh", _text("A" * 10**6), "line 1: expected MeshVersionFormatted"),
    "tetrahedra of Medit": (
        "a.mesh",
        _text(MEDIT.replace("End", "Tetrahedra 1\n1 2 3 4 1\nEnd")),
        "line 9: 1 Tetrahedra: only triangles of three nodes, quadrilaterals of four and edges of two can be used",
    ),
    "second order of Medit": (
        "a.mesh",
        _text(MEDIT.replace("End", "TrianglesP2 1\n1 2 3 4 1 2 1\nEnd")),
        "line 9: 1 TrianglesP2: only triangles",
    ),
    "node of Medit": (
        "a.mesh",
        _text(MEDIT.replace("1 3 4 1", "1 3 9 1")),
        "cell 2 has the node 9: expected 1 to 4",
    ),
    "broken Medit": ("a.mesh", _text(MEDIT.partition("\n1 3 4")[0]), "8 values should follow, and 4 do"),
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
    "tetrahedron": (
        "a.vtk",
        _vtk({"tetra": [[0, 1, 2, 3]]}, phase=[0]),
        "1 cells are tetrahedra, the first is number 0",
    ),
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
