"""Files of VTK as its own writers make them, in all forms, and faulty and hostile ones: each has its line."""

import base64
import lzma
import re
import zlib
from collections.abc import Callable
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from support.vtk_files import write_vtk, write_vtu
from unit.mesh.faulty_meshes import grid

from feti_homog.errors import MeshError
from feti_homog.mesh.coarse_mesh import areas
from feti_homog.mesh.readers import vtk_file
from feti_homog.mesh.readers.msh_reader import read
from feti_homog.mesh.readers.raw_mesh import RawMesh
from feti_homog.mesh.readers.vtk_file import load_medit
from feti_homog.mesh.readers.vtu_file import load

MODES = ("Ascii", "Binary", "Appended raw", "Appended base64")
COMPRESSORS = ("None", "ZLib", "LZMA")


def assert_is_grid(raw: RawMesh) -> None:
    assert np.array_equal(raw.points, list(grid().nodes.values()))
    assert np.array_equal(raw.triangles + 1, [e[3] for e in grid().elements.values()])
    names = [raw.groups[k][0] for k in raw.group]
    assert names == [("matrix", "fibre")[e[1] - 1] for e in grid().elements.values()]


@pytest.mark.parametrize(("mode", "compressor"), list(product(MODES, COMPRESSORS)))
@pytest.mark.parametrize("header", [32, 64])
def test_every_form_of_data_is_read(mode, compressor, header, tmp_path):
    """Base64 is decoded strictly: nothing may follow its padding."""
    assert_is_grid(load(write_vtu(tmp_path / "a.vtu", mode, compressor, HeaderType=header)))


@pytest.mark.parametrize("mode", MODES[1:])
@pytest.mark.parametrize("compressor", COMPRESSORS[:2])
def test_most_significant_bytes_may_come_first(mode, compressor, tmp_path):
    assert_is_grid(load(write_vtu(tmp_path / "a.vtu", mode, compressor, ByteOrder=0)))


@pytest.mark.parametrize("mode", MODES[1:])
def test_data_in_many_blocks_are_joined(mode, tmp_path):
    path = write_vtu(tmp_path / "a.vtu", mode, BlockSize=64)
    assert_is_grid(load(path))


def test_all_pieces_are_read(tmp_path):
    """The upper half of the grid is a piece of its own, whose nodes are numbered anew."""
    text = write_vtu(tmp_path / "a.vtu", "Ascii").read_text()
    head, piece, tail = re.split(r"(<Piece.*</Piece>)", text, flags=re.DOTALL)
    other = re.sub(
        r'(Name="Points".*?>)(.*?)(</DataArray>)',
        lambda m: m[1] + " ".join(str(float(w) + (k % 3 == 1)) for k, w in enumerate(_numbers(m[2]))) + m[3],
        piece,
        flags=re.DOTALL,
    )
    (tmp_path / "a.vtu").write_text(head + piece + other + tail)
    raw = load(tmp_path / "a.vtu")
    assert len(raw.triangles) == 64 and len(raw.points) == 50
    assert np.abs(areas(raw.points[:, :2], raw.triangles)).sum() == pytest.approx(2.0)
    with pytest.raises(MeshError, match=r"nodes at the same place \(merge nodes\): node 20"):
        read(tmp_path / "a.vtu")


def test_cell_data_must_be_in_all_pieces(tmp_path):
    text = write_vtu(tmp_path / "a.vtu", "Ascii").read_text()
    head, piece, tail = re.split(r"(<Piece.*</Piece>)", text, flags=re.DOTALL)
    (tmp_path / "a.vtu").write_text(head + piece + piece.replace('Name="phase"', 'Name="other"') + tail)
    with pytest.raises(MeshError, match=r"cell data (phase|other): missing in one of 2 pieces"):
        load(tmp_path / "a.vtu")


def _numbers(text: str) -> list[str]:
    return re.sub(r"<InformationKey.*</InformationKey>", "", text, flags=re.DOTALL).split()


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("compressor", COMPRESSORS)
def test_broken_off_data_are_refused(mode, compressor, tmp_path):
    content = write_vtu(tmp_path / "a.vtu", mode, compressor).read_bytes()
    last = b"</AppendedData>" if mode.startswith("App") else b"</DataArray>"
    stop = content.rfind(last)
    cut = stop - content[:stop][::-1].find(content[:stop].rstrip()[::-1][:1]) - 9
    (tmp_path / "a.vtu").write_bytes(content[:cut] + content[stop:])
    with pytest.raises(MeshError):
        read(tmp_path / "a.vtu")


NUMBERS = ("int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64", "float32", "float64")


@pytest.mark.parametrize("kind", NUMBERS)
@pytest.mark.parametrize(("form", "version"), list(product(("ASCII", "Binary"), (42, 51))))
def test_every_type_of_numbers_of_legacy_files_is_read(form, version, kind, tmp_path):
    """VTK writes unsigned bytes as colours, and as text divided by 255."""
    assert_is_grid(vtk_file.load(write_vtk(tmp_path / "a.vtk", form, version, kind)))


meshio = pytest.importorskip("meshio")


SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
HALVES = {"triangle": [[0, 1, 2], [0, 2, 3]]}


def _vtk(kinds: dict[str, list], **data: list) -> Callable[[Path], None]:
    return meshio.Mesh(SQUARE, list(kinds.items()), cell_data={k: [np.array(v)] for k, v in data.items()}).write


def _changed(old: str, new: str, **options) -> Callable[[Path], None]:
    """Write the halves of a square with some other text in it."""

    def write(path: Path) -> None:
        _vtk(HALVES, phase=[0, 0])(path, **options)
        content = path.read_bytes()
        assert old.encode() in content
        path.write_bytes(content.replace(old.encode(), new.encode(), 1))

    return write


def _packed(compressor: str, compress: Callable[[bytes], bytes]) -> str:
    """Return the phases of a square as 128 MB of compressed zeros."""
    block = compress(bytes(2**27))
    header = np.array([1, 2**31, 0, len(block)], "<u4").tobytes()
    text = (base64.b64encode(header) + base64.b64encode(block)).decode()
    array = f'<DataArray type="Int8" Name="phase" format="binary">{text}</DataArray>'
    return (
        f'<VTKFile type="UnstructuredGrid" byte_order="LittleEndian" compressor="{compressor}"><UnstructuredGrid>'
        f'<Piece NumberOfPoints="0" NumberOfCells="0"><Points/><Cells/><CellData>{array}</CellData></Piece>'
        "</UnstructuredGrid></VTKFile>"
    )


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


def test_empty_sections_of_netgen_are_none(tmp_path):
    (tmp_path / "a.mesh").write_text(MEDIT.replace("Ridges 0", "Tetrahedra\n0\nQuadrilaterals\n0"))
    assert len(load_medit(tmp_path / "a.mesh").triangles) == 2


FAULTS = [
    ("not XML: syntax error: line 1, column 0", "a.vtu", "hello"),
    ("cannot be read", "a.vtk", lambda path: path),
    ("no cell data named phase, the file has density: expected whole", "a.vtu", _vtk(HALVES, density=[1.0, 2.5])),
    ("no cell data named phase, the file has a, b: expected", "a.vtu", _vtk(HALVES, a=[1.0, 2.0], b=[1.0, 1.0])),
    *((f"cell data phase = {value:g}: expected 0, 1, 2", "a.vtu", _vtk(HALVES, phase=[0.0, value]))
      for value in (-1.0, 1e18, 1e30, float("inf"), float("nan"))),
    ("cell 0 has the node 9: expected 0 to 3", "a.vtu", _vtk({"triangle": [[0, 1, 9]]}, phase=[0])),
    ("cell 0 has the node -1: expected 0 to 3", "a.vtk", _vtk({"triangle": [[0, 1, -1]]}, phase=[0])),
    ("cell data phase: expected one value for", "a.vtu", _vtk(HALVES, phase=[[0, 0], [0, 0]])),
    ("not XML: mismatched tag: line 51, column 2", "a.vtu", _changed("</Piece>", "</Peace>", **TEXT)),
    ('header_type is "Int64": expected UInt32 or UInt64',
     "a.vtu", _changed("<VTKFile ", '<VTKFile header_type="Int64" ')),
    ("1 cells are polyhedra, the first is number 0: only triangles of three or six nodes and quadrilaterals",
     "a.vtu", _changed("5\n5\n", "42\n5\n", **TEXT)),
    ("cell 0, of type 5, has 1 nodes: expected 3", "a.vtu", _changed("3\n6\n", "1\n6\n", **TEXT)),
    ("the cells and their nodes do not belong together: the file is damaged",
     "a.vtu", _changed("3\n6\n", "3\n1000000000\n", **TEXT)),
    ('array "connectivity": "one": expected a whole number',
     "a.vtu", _changed("0\n1\n2\n", "0\none\n2\n", **TEXT)),
    ('compressor is "vtkLZ4DataCompressor": expected vtkZLibDataCompressor or vtkLZMADataCompressor',
     "a.vtu", _changed("vtkZLibDataCompressor", "vtkLZ4DataCompressor")),
    ("<PolyData> in <VTKFile>: expected UnstructuredGrid and AppendedData",
     "a.vtu", '<VTKFile type="PolyData"><PolyData><Piece NumberOfPoints="0"/></PolyData></VTKFile>'),
    ("<Polys> in <Piece>: expected Points and Cells and CellData and PointData",
     "a.vtu", _changed("<CellData>", "<Polys></Polys><CellData>", **TEXT)),
    ("2 types of cells: expected 1", "a.vtu", _changed('NumberOfCells="2"', 'NumberOfCells="1"')),
    ("299999999997 values should follow, and", "a.vtk", _changed("POINTS 4 ", "POINTS 99999999999 ")),
    ("1000000000000 values should follow, and", "a.vtk", _changed("CELLS 3 6", "CELLS 3 1000000000000")),
    ("1000000000000 values should follow, and",
     "a.vtk", _changed("phase 1 2 vtktypeint64", "phase 1000000 1000000 vtktypeint64")),
    ("line 22: CELL_TYPES: it is there twice",
     "a.vtk", _changed("CELL_DATA 2", "CELL_TYPES 2\n5\n5\nCELL_DATA 2", **TEXT)),
    ('line 22: "POLYGONS": expected DATASET, POINTS, CELLS',
     "a.vtk", _changed("CELL_DATA 2", "POLYGONS 1 4\n3 0 1 2\nCELL_DATA 2", **TEXT)),
    ("1 cells are triangle strips, the first is number 0: only triangles",
     "a.vtk", _changed("5\n5\n", "6\n5\n", **TEXT)),
    ("line 1: expected MeshVersionFormatted", "a.mesh", "A" * 10**6),
    ("line 9: 1 Tetrahedra: only triangles of three nodes, quadrilaterals of four and edges of two can be used",
     "a.mesh", MEDIT.replace("End", "Tetrahedra 1\n1 2 3 4 1\nEnd")),
    ("line 9: 1 TrianglesP2: only triangles", "a.mesh", MEDIT.replace("End", "TrianglesP2 1\n1 2 3 4 1 2 1\nEnd")),
    ("cell 2 has the node 9: expected 1 to 4", "a.mesh", MEDIT.replace("1 3 4 1", "1 3 9 1")),
    ("8 values should follow, and 4 do", "a.mesh", MEDIT.partition("\n1 3 4")[0]),
    ("DATASET STRUCTURED_POINTS: expected UNSTRUCTURED_GRID",
     "a.vtk", "# vtk DataFile Version 4.2\na\nASCII\nDATASET STRUCTURED_POINTS\nDIMENSIONS 9999999 9999999 1\n"),
    ("its compressed data are too large for a file", "a.vtu", _packed("vtkZLibDataCompressor", zlib.compress)),
    ("its compressed data are too large for a file", "a.vtu", _packed("vtkLZMADataCompressor", lzma.compress)),
    ("cell data phase = 0.5: expected 0, 1, 2, ...", "a.vtu", _vtk(HALVES, phase=[0.0, 0.5])),
    ("1 cells are tetrahedra, the first is number 0", "a.vtk", _vtk({"tetra": [[0, 1, 2, 3]]}, phase=[0])),
    ("no triangles in it", "a.vtu", _vtk({"line": [[0, 1]]}, phase=[0])),
    ('no value of phase is named "matrix"', "a.vtu", _vtk(HALVES, phase=[1, 3])),
    ("no node between the corners of the left, right, lower", "a.vtu", _vtk(HALVES, phase=[0, 0])),
]  # fmt: skip


@pytest.mark.parametrize(("message", "file", "write"), FAULTS, ids=[words for words, *_ in FAULTS])
def test_faulty_mesh_is_refused(message, file, write, tmp_path):
    if isinstance(write, str):
        (tmp_path / file).write_text(write)
    else:
        write(tmp_path / file)
    with pytest.raises(MeshError) as caught:
        read(tmp_path / file)
    assert any(message in fault for fault in caught.value.faults), caught.value
    assert all(file in fault and "\n" not in fault for fault in caught.value.faults)
