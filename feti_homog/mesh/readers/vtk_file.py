"""Read the triangles and the lines of a file of VTK or Medit by meshio, within bounds on what it allocates."""

from __future__ import annotations

import importlib
import io
import re
import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stderr
from functools import partial
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any
from xml.etree import ElementTree

import numpy as np

from feti_homog.errors import MeshError
from feti_homog.mesh.readers.raw_mesh import DEBONDED, Block, RawMesh, assembled
from feti_homog.schema.wording import toml_value
from feti_homog.system.runtime import input_files
from feti_homog.typing import Int

# Readers of meshio, and how many nodes its triangles have.
READERS = {".vtu": "meshio.vtu", ".vtk": "meshio.vtk", ".mesh": "meshio.medit"}
NODES = {"triangle": 3, "triangle6": 6, "quad": 4}
LINES = ("line", "line3")
VERTEX = "vertex"
PHASE = "phase"
# Cell data by which other programs number materials, in the order of precedence.
NUMBERS = (
    "medit:ref",
    "gmsh:physical",
    "CellEntityIds",
    "mat_id",
    "MaterialIds",
    "material",
    "cell_tags",
    "region",
    "gmsh:geometrical",
)
MOST_PHASES = 10**9
# Bytes that compressed data may have: so many in any file, or so many for each of the file's.
MOST_BYTES, MOST_RATIO = 2**26, 50
# Modules by which meshio decompresses, and what makes a decompressor that stops where it should.
DECOMPRESSORS = {"zlib": "decompressobj", "lzma": "LZMADecompressor"}
# Sizes that sections of a legacy file declare, and arrays of its fields: components, tuples and a type.
DECLARED = re.compile(
    rb"(?im)^(POINTS|CELLS|CELL_TYPES|POINT_DATA|CELL_DATA|LOOKUP_TABLE|COLOR_SCALARS)\b([^\n]{0,200})"
)
ARRAY = re.compile(rb"(?im)^\S{1,200} (\d+) (\d+) [a-z][a-z_0-9]{0,20}\s*$")
DATASET = re.compile(rb"(?im)^DATASET\s+(\S{1,60})")
COUNTED = re.compile(rb"([A-Z][A-Za-z0-9]{0,40})\s+([0-9]{1,40})")
RAW = re.compile(rb"(<AppendedData[^>]*>).*(</AppendedData>)", re.DOTALL)


def load(path: Path) -> RawMesh:
    """Read the triangles and the lines of a .vtu, .vtk or .mesh file.

    Its cell data `phase` are 0 in the matrix, 1 in phase fibre, k in fibre:k; in their place the groups are those of
    one of NUMBERS, or of the only cell data of whole numbers. Its cell data `debonded`, if it has them, are 1 on lines
    that are debonded from the start.  Nodes and elements have the numbers of the file, from 0.

    Raises:
        OSError: the file cannot be read.
        MeshError: meshio is not installed or cannot read the file, it has other elements, or no phases.
    """
    try:
        reader = importlib.import_module(READERS[path.suffix])
    except ImportError:
        wanted = f"{path.suffix} files are read by meshio, which is not installed"
        raise MeshError(f"{wanted}: pip install 'feti_homog[meshes]'") from None
    content = input_files.read(path)
    _check_content(content, path.suffix)
    try:
        with _bounded(reader, len(content)):
            mesh = reader.read(str(path))
    except Exception as error:  # meshio's readers raise whatever they meet
        raise MeshError(f"meshio cannot read it: {str(error).strip() or type(error).__name__}") from None
    faults = _faults(mesh) or _misfits(mesh)
    if faults:
        raise MeshError(*faults)
    return _raw(mesh)


def _faults(mesh: Any) -> list[str]:
    """Elements that are not triangles, the lack of these, and of their phases."""
    kinds = [block.type for block in mesh.cells]
    others = [f"{len(block.data)} {block.type}" for block in mesh.cells if block.type not in (*NODES, *LINES, VERTEX)]
    faults = [
        f"elements are {kind}: only triangles of three or six nodes and quadrilaterals of four can be used"
        for kind in others
    ]
    if not others and not set(kinds) & set(NODES):
        faults.append("no triangles in it")
    name = _numbers_name(mesh)
    if not name:
        expected = "expected 0 in the matrix, 1 in phase fibre, 2 in fibre:2, ..."
        faults.append(f"no cell data named {PHASE}, but {', '.join(mesh.cell_data) or 'none'}: {expected}")
    elif not faults:
        values = np.concatenate([np.ravel(data) for data in mesh.cell_data[name]])
        bad = values[~((values == np.round(values)) & (values >= 0) & (values < MOST_PHASES))]
        if len(bad):
            faults.append(f"cell data {name} = {bad[0]:g}: expected 0, 1, 2, ... below {MOST_PHASES}")
    return faults


def _numbers_name(mesh: Any) -> str:
    """Return the name of the cell data with the phase of an element; empty if there are none."""
    if known := [name for name in (PHASE, *NUMBERS) if name in mesh.cell_data]:
        return known[0]
    whole = [
        name
        for name, data in mesh.cell_data.items()
        if name != DEBONDED and all(np.size(d) == len(d) and np.asarray(d).dtype.kind in "iu" for d in data)
    ]
    return whole[0] if len(whole) == 1 else ""


def _misfits(mesh: Any) -> list[str]:
    """Nodes of elements that are not there, and data of another number of elements or coordinates."""
    count, faults = len(mesh.points), []
    if mesh.points.ndim != 2 or mesh.points.shape[1] not in (2, 3):
        faults.append("points have neither two nor three coordinates")
    for number, cells in enumerate(mesh.cells):
        nodes = np.asarray(cells.data)
        bad = nodes[(nodes < 0) | (nodes >= count)]
        if len(bad):
            faults.append(f"a {cells.type} has the node {bad[0]}: expected 0 to {count - 1}")
        for name in {_numbers_name(mesh), DEBONDED} & set(mesh.cell_data):
            own = mesh.cell_data[name][number : number + 1]
            if [np.size(values) for values in own] != [len(nodes)]:
                faults.append(f"cell data {name}: expected one value for each of {len(nodes)} {cells.type}")
    return faults


def _raw(mesh: Any) -> RawMesh:
    first, blocks, name = 0, [], _numbers_name(mesh)
    for cells, data in zip(mesh.cells, mesh.cell_data[name], strict=True):
        tags = first + np.arange(len(cells.data))
        first += len(tags)
        if cells.type in NODES:
            blocks.append(Block(tags, np.asarray(cells.data, np.int64), np.ravel(data).astype(np.int64)))
    points = np.zeros((len(mesh.points), 3))
    points[:, : mesh.points.shape[1]] = mesh.points
    blocks, values = _used(blocks)
    aliases = [(f"number {k}",) for k in values]
    groups = [(("matrix", "fibre")[k] if k < 2 else f"fibre:{k}",) for k in values] if name == PHASE else aliases
    containers = (f"value of {name}", "cells")
    return assembled(np.arange(len(points)), points, blocks, groups, _curves(mesh, name), containers, aliases)


def _curves(mesh: Any, name: str) -> dict[str, Int]:
    """Nodes (d, 2) at the ends of the lines that cell data `debonded` mark, and of the others by their number.

    The number is in the cell data of that name or, if these are phases, the cells' type.
    """
    curves: dict[str, list[Int]] = {}
    marks = mesh.cell_data.get(DEBONDED, [np.zeros(len(cells.data)) for cells in mesh.cells])
    for cells, mark, numbers in zip(mesh.cells, marks, mesh.cell_data[name], strict=True):
        if cells.type in LINES:
            ends, is_debonded = np.asarray(cells.data, np.int64)[:, :2], np.ravel(mark) != 0
            own = [(DEBONDED, is_debonded)]
            if name == PHASE:
                own.append((cells.type, ~is_debonded))
            else:
                values = np.ravel(numbers).astype(np.int64)
                own += [(f"number {k}", ~is_debonded & (values == k)) for k in np.unique(values).tolist()]
            for curve, members in own:
                if members.any():
                    curves.setdefault(curve, []).append(ends[members])
    return {curve: np.concatenate(ends) for curve, ends in curves.items()}


def _used(blocks: list[Block]) -> tuple[list[Block], list[int]]:
    """Return the blocks with groups numbered without gaps, and the values of these groups."""
    used: Int = np.unique(np.concatenate([block.group for block in blocks]))
    renumbered = [Block(block.tags, block.nodes, np.searchsorted(used, block.group)) for block in blocks]
    return renumbered, used.tolist()


def _check_content(content: bytes, suffix: str) -> None:
    """Raise MeshError where a file of this kind is damaged, or declares what meshio should not read."""
    {".vtu": _check_xml, ".vtk": _check_legacy, ".mesh": _check_medit}[suffix](content)


def _check_medit(content: bytes) -> None:
    for name, count in COUNTED.findall(content):
        if int(count) > len(content):
            raise MeshError(f"it declares {int(count)} {name.decode()}: there are {len(content)} bytes in all")


def _check_xml(content: bytes) -> None:
    if re.search(rb"<AppendedData[^>]*[\"']raw[\"']", content):
        content = RAW.sub(rb"\1\2", content)
    try:
        root = ElementTree.fromstring(content)
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise MeshError(f"not XML: {error}") from None
    header = root.get("header_type", "UInt32")
    if header not in ("UInt32", "UInt64"):
        raise MeshError(f"header_type is {toml_value(header)}: expected UInt32 or UInt64")
    if any(array.get("Name") in ("faces", "faceoffsets") for array in root.iter("DataArray")):
        raise MeshError("elements are polyhedra: only triangles of three or six nodes can be used")


def _check_legacy(content: bytes) -> None:
    for kind in DATASET.findall(content):
        if kind.upper() != b"UNSTRUCTURED_GRID":
            raise MeshError(f"DATASET {kind.decode(errors='replace')}: expected UNSTRUCTURED_GRID")
    sizes = [
        (name, int(word))
        for name, words in DECLARED.findall(content)
        for word in re.findall(rb"(?<!\S)\d{1,40}(?!\S)", words)
    ]
    sizes += [(b"an array", int(components[:40]) * int(tuples[:40])) for components, tuples in ARRAY.findall(content)]
    for name, size in sizes:
        if size > len(content):
            words = f"{name.decode()} of {size} values"
            raise MeshError(f"it declares {words}: there are {len(content)} bytes in all")


@contextmanager
def _bounded(reader: ModuleType, length: int) -> Iterator[None]:
    """Let meshio decompress no more data than a file of this length should have, and print nothing."""
    left = max(MOST_BYTES, MOST_RATIO * length)

    def decompress(make: Callable[[], Any], content: bytes) -> bytes:
        nonlocal left
        decompressor = make()
        data: bytes = decompressor.decompress(content, left + 1)
        left -= len(data)
        if left < 0:
            raise MeshError("its compressed data are too large for a file of its length")
        if not decompressor.eof:
            raise MeshError("its compressed data are broken off")
        return data

    inner = sys.modules.get(f"{reader.__name__}._vtu")
    kept = {name: module for name in DECOMPRESSORS if (module := getattr(inner, name, None))}
    for name, module in kept.items():
        own = partial(decompress, getattr(module, DECOMPRESSORS[name]))
        setattr(inner, name, SimpleNamespace(decompress=own))
    try:
        with redirect_stderr(io.StringIO()), warnings.catch_warnings():
            warnings.filterwarnings("error", "string or file could not be read")  # what is no number
            yield
    finally:
        for name, module in kept.items():
            setattr(inner, name, module)
