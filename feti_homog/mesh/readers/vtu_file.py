"""Read triangles and lines from XML files of VTK (.vtu): text, base64 or raw, compressed or not."""

from __future__ import annotations

import base64
import lzma
import re
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from feti_homog.errors import MeshError
from feti_homog.mesh.readers.raw_mesh import RawMesh
from feti_homog.mesh.readers.unstructured_grid import Grid, NotANumber, Numbers, mesh_of, numbers
from feti_homog.schema import wording
from feti_homog.system.runtime import input_files

TYPES = {f"{sign}Int{8 * size}": f"{kind}{size}" for sign, kind in (("", "i"), ("U", "u")) for size in (1, 2, 4, 8)}
TYPES |= {"Float32": "f4", "Float64": "f8"}
ORDERS = {"LittleEndian": "<", "BigEndian": ">"}
COMPRESSORS = {"vtkZLibDataCompressor": zlib.decompressobj, "vtkLZMADataCompressor": lzma.LZMADecompressor}
# Limit for decompressed data: bytes for any file, and bytes for each byte of the file; the larger limit counts.
MOST_BYTES, MOST_RATIO = 2**26, 50
ARRAYS = ("connectivity", "offsets", "types")
SEGMENT = re.compile(rb"[^=]+={0,2}")


def load(path: Path) -> RawMesh:
    """Read triangles and lines, numbered from 0 through all pieces of a file.

    Raises:
        OSError: the file cannot be read.
        MeshError: the file is damaged, or has unusable cells or no phases.
    """
    content = input_files.read(path)
    size, start, stop, appended = len(content), content.find(b"<AppendedData"), content.rfind(b"</AppendedData>"), b""
    if 0 <= start < stop and (head := content.find(b">", start, stop)) > 0:
        appended = content[head + 1 : stop]
        appended = appended[appended.find(b"_") + 1 :]
        content = content[: head + 1] + content[stop:]
    try:
        root = ElementTree.fromstring(content)
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise MeshError(f"not XML: {error}") from None
    (grid,) = _children(root, "VTKFile", {"UnstructuredGrid": 1, "AppendedData": 0})["UnstructuredGrid"]
    arrays = _Arrays(root, appended, max(MOST_BYTES, MOST_RATIO * size))
    pieces, tables, first_node = [], list[dict[str, Numbers]](), 0
    for piece in _children(grid, grid.tag, {"Piece": 1, "FieldData": 0})["Piece"]:
        sections = _children(piece, "Piece", {"Points": 1, "Cells": 1, "CellData": 0, "PointData": 0})
        sizes = []
        for name in ("NumberOfPoints", "NumberOfCells"):
            word = piece.get(name, "").strip()
            if not re.fullmatch("[0-9]{1,15}", word):
                raise MeshError(f"{name} is {wording.toml_value(word)}: expected a whole number")
            sizes.append(int(word))
        points = next(iter(arrays.of(sections["Points"][0]).values()), np.zeros(0))
        cells = arrays.of(sections["Cells"][0])
        if sizes[1] and (missing := [name for name in ARRAYS if name not in cells]):
            raise MeshError(f"no array {missing[0]} of the cells")
        nodes, ends, types = (np.ravel(cells.get(name, np.zeros(0))).astype(np.int64) for name in ARRAYS)
        if np.size(points) != 3 * sizes[0]:
            raise MeshError(f"{np.size(points)} coordinates of points: expected {3 * sizes[0]}")
        if len(types) != sizes[1]:
            raise MeshError(f"{len(types)} types of cells: expected {sizes[1]}")
        data = arrays.of(sections["CellData"][0]) if sections["CellData"] else {}
        tables += [data] if sizes[1] else []
        pieces.append((points.reshape(-1, 3).astype(float), types, nodes + first_node, np.diff(ends, prepend=0)))
        first_node += sizes[0]
    points, types, nodes, counts = (np.concatenate(parts) for parts in zip(*pieces, strict=True))
    tables = tables or [{}]
    if missing_names := set[str]().union(*tables) - set(tables[0]).intersection(*tables):
        raise MeshError(f"cell data {min(missing_names)}: missing in one of {len(tables)} pieces")
    data = {name: np.concatenate([table[name] for table in tables]) for name in tables[0]}
    return mesh_of(Grid(points, types, nodes, counts, data))


def _children(element: ElementTree.Element, name: str, tags: Mapping[str, int]) -> dict[str, list[Any]]:
    """Group the children of an XML element by tag, from `tags`; MeshError for unknown, missing or repeated children."""
    children: dict[str, list[Any]] = {tag: element.findall(tag) for tag in tags}
    other = [child.tag for child in element if child.tag not in tags]
    expected = f"expected {' and '.join(tags)}"
    if other:
        raise MeshError(f"<{other[0]}> in <{name}>: {expected}")
    if missing := [tag for tag, fewest in tags.items() if len(children[tag]) < fewest]:
        raise MeshError(f"no <{missing[0]}> in <{name}>: {expected}")
    if name != "UnstructuredGrid" and (several := [tag for tag in tags if len(children[tag]) > 1]):
        raise MeshError(f"<{several[0]}> is there twice in <{name}>: expected it once")
    return children


class _Arrays:
    """A decoder of the arrays in a .vtu file, limited to `budget` decompressed bytes; raises MeshError."""

    def __init__(self, root: ElementTree.Element, appended: bytes, budget: int) -> None:
        kind, compressor = root.get("type"), root.get("compressor", "")
        header, order = root.get("header_type", "UInt32"), root.get("byte_order", "LittleEndian")
        expected = {
            "type": (kind, ("UnstructuredGrid",)),
            "header_type": (header, ("UInt32", "UInt64")),
            "byte_order": (order, (*ORDERS,)),
            "compressor": (compressor, ("", *COMPRESSORS)),
        }
        for name, (value, choices) in expected.items():
            if value not in choices:
                choice = " or ".join(filter(None, choices))
                raise MeshError(f"{name} is {wording.toml_value(value or '')}: expected {choice}")
        self.order, self.budget = ORDERS[order], budget
        self.header = np.dtype(f"{self.order}{TYPES[header]}")
        self.decompressor: Any = COMPRESSORS.get(compressor)
        self.appended, self.is_raw = appended, root.find("AppendedData[@encoding='raw']") is not None
        starts = {self._offset(array) for array in root.iter("DataArray") if array.get("format") == "appended"}
        self.starts = [*sorted(starts), len(appended)]

    def of(self, section: ElementTree.Element) -> dict[str, Numbers]:
        """Read the numeric arrays of a section: name -> (k,) or (k, width).  Raises MeshError for damaged data."""
        arrays = {}
        for array in section.iter("DataArray"):
            name, kind = array.get("Name") or "Points", TYPES.get(array.get("type", ""))
            if kind is None:
                continue  # texts and bits
            form, data = array.get("format", "ascii"), (array.text or "").encode()
            try:
                if form == "ascii":
                    values = numbers(data, "f8" if kind[0] == "f" else "i8")
                elif form in ("binary", "appended"):
                    if form == "appended":
                        start = self._offset(array)
                        data = self.appended[start : next((other for other in self.starts if other > start), start)]
                    if not (self.is_raw and form == "appended"):
                        # Header and data may be encoded separately, each with its own padding.
                        parts = SEGMENT.findall(b"".join(data.split()))
                        data = b"".join(base64.b64decode(part, validate=True) for part in parts)
                    values = np.frombuffer(self._unpacked(data), f"{self.order}{kind}")
                else:
                    raise MeshError(f"format is {wording.toml_value(form)}: expected ascii, binary or appended")
                width = int(array.get("NumberOfComponents") or 1)
                arrays[name] = values if width == 1 else values.reshape(-1, width)
            except NotANumber as error:
                raise MeshError(f"array {wording.toml_value(name)}: {error}") from None
            except (ValueError, IndexError, zlib.error, lzma.LZMAError):
                raise MeshError(f"array {wording.toml_value(name)}: its data are damaged or broken off") from None
        return arrays

    def _offset(self, array: ElementTree.Element) -> int:
        word = array.get("offset", "").strip()
        if not re.fullmatch("[0-9]{1,15}", word) or int(word) > len(self.appended):
            expected = f"expected one in {len(self.appended)} appended bytes"
            raise MeshError(f"offset is {wording.toml_value(word)}: {expected}")
        return int(word)

    def _unpacked(self, data: bytes) -> bytes:
        """Unpack data behind a header of lengths; ValueError or IndexError for short data, MeshError over `budget`."""
        header = np.frombuffer(data, self.header, len(data) // self.header.itemsize)
        count, first = (int(header[0]), 3) if self.decompressor else (1, 0)
        lengths, start, unpacked = header[first : first + count].tolist(), (first + count) * self.header.itemsize, []
        if len(lengths) < count:
            raise ValueError
        for length in lengths:
            block, start = data[start : start + length], start + length
            is_complete = len(block) == length
            if self.decompressor:
                decompressor = self.decompressor()
                block = decompressor.decompress(block, self.budget + 1)
                self.budget -= len(block)
                if self.budget < 0:
                    raise MeshError("its compressed data are too large for a file of its length")
                is_complete = decompressor.eof
            if not is_complete:
                raise ValueError
            unpacked.append(block)
        return b"".join(unpacked)
