"""Files as VTK's own writers make them: text, base64 and raw, compressed or not, in both byte orders, legacy files."""

import re
from itertools import product

import numpy as np
import pytest
from support.vtk_files import write_vtk, write_vtu
from unit.mesh.faulty_meshes import grid

from feti_homog.errors import MeshError
from feti_homog.mesh.coarse_mesh import areas
from feti_homog.mesh.readers import vtk_file
from feti_homog.mesh.readers.msh_reader import read
from feti_homog.mesh.readers.raw_mesh import RawMesh
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


def test_lz4_is_refused(tmp_path):
    with pytest.raises(MeshError, match=r'compressor is "vtkLZ4DataCompressor": expected vtkZLibDataCompressor or'):
        read(write_vtu(tmp_path / "a.vtu", compressor="LZ4"))


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
