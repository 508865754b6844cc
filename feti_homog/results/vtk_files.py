"""States of a result as files of VTK, with all fields that follow: .vtu, a file for each state, or one .vtkhdf.

VTK's file formats: https://docs.vtk.org/en/latest/vtk_file_formats.
"""

from __future__ import annotations

import base64
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import h5py
import numpy as np

from feti_homog.errors import CaseError
from feti_homog.results import atomic, field_file
from feti_homog.results.viewed_states import ViewedState, cell_state, interface_state
from feti_homog.typing import Array

FORMATS = ("vtu", "vtkhdf")
KINDS = {1: 1, 3: 5, 6: 22}  # VTK's numbers of a vertex and of triangles, by their nodes
TYPES = {"f4": "Float32", "f8": "Float64", "i1": "Int8", "i4": "Int32", "i8": "Int64", "u1": "UInt8"}
PARTS = {"cell": cell_state, "interface": interface_state}


def write(directory: Path, kind: str) -> list[Path]:
    """Write the states of `directory`/result.h5 as `kind`, one of `FORMATS`; returns the paths.  Call on one rank.

    `vtu`: cell_0000.vtu, ... and cell.pvd, which lists them; `vtkhdf`: cell.vtkhdf with all states as steps.  With
    interface nodes interface_0000.vtu, ... or interface.vtkhdf too.

    Raises:
        CaseError: there is no result.h5.
        FetiHomogError: it cannot be read, or a file cannot be written.
    """
    path = directory / field_file.NAME
    if not path.is_file():
        raise CaseError(f"{path}: it is missing; a run writes it with `fields = true` in [output]")
    with atomic.file_errors("read", path), h5py.File(path, "r", locking=False) as file:
        parts = {name: read for name, read in PARTS.items() if name == "cell" or len(file["interface/points"])}
        writer = _write_vtu if kind == "vtu" else _write_vtkhdf
        return [path for name, read in parts.items() for path in writer(directory, name, read, file)]


def _write_vtu(directory: Path, name: str, read: Any, file: Any) -> list[Path]:
    collection = ET.Element("VTKFile", type="Collection", version="0.1")
    listed, paths = ET.SubElement(collection, "Collection"), list[Path]()
    for number in range(len(file["state"])):
        path = directory / f"{name}_{number:04d}.vtu"
        paths.append(atomic.replace(path, ET.ElementTree(_grid(read(file, number))).write))
        ET.SubElement(listed, "DataSet", timestep=str(number), file=path.name)
    paths.append(atomic.replace(directory / f"{name}.pvd", ET.ElementTree(collection).write))
    return paths


def _grid(state: ViewedState) -> ET.Element:
    """Return a state as VTK's XML, its arrays in base64."""
    root = ET.Element(
        "VTKFile", type="UnstructuredGrid", version="1.0", byte_order="LittleEndian", header_type="UInt64"
    )
    m, columns = state.cells.shape
    sizes = {"NumberOfPoints": str(len(state.points)), "NumberOfCells": str(m)}
    piece = ET.SubElement(ET.SubElement(root, "UnstructuredGrid"), "Piece", sizes)
    cells = {
        "connectivity": state.cells.ravel(),
        "offsets": columns * np.arange(1, m + 1),
        "types": np.full(m, KINDS[columns], np.uint8),
    }
    groups = {"Points": {"Points": state.points}, "Cells": cells, "PointData": state.nodes, "CellData": state.elements}
    for name, arrays in groups.items():
        group = ET.SubElement(piece, name)
        for own, array in arrays.items():
            group.append(_array(own, array))
    return root


def _array(name: str, array: Array) -> ET.Element:
    values = np.ascontiguousarray(array, array.dtype.newbyteorder("<"))
    form = {"type": TYPES[values.dtype.str[1:]], "Name": name, "format": "binary"}
    columns = {"NumberOfComponents": str(values.shape[1])} if values.ndim == 2 else {}
    element = ET.Element("DataArray", form | columns)
    element.text = base64.b64encode(np.uint64(values.nbytes).tobytes() + values.tobytes()).decode()
    return element


def _write_vtkhdf(directory: Path, name: str, read: Any, file: Any) -> list[Path]:
    def fill(part: Path) -> None:
        with h5py.File(part, "w") as out:
            root = out.create_group("VTKHDF")
            root.attrs["Version"] = np.array([2, 0])
            root.attrs.create("Type", b"UnstructuredGrid", dtype="S16")
            _fill_vtkhdf(root, read, file)

    return [atomic.replace(directory / f"{name}.vtkhdf", fill)]


def _fill_vtkhdf(root: Any, read: Any, file: Any) -> None:
    """Put the mesh, which all states share, and the fields, one state after the other, into the group of a file."""
    count = len(file["state"])
    steps = root.create_group("Steps")
    steps.attrs["NSteps"] = count
    steps["Values"] = np.arange(count, dtype=float)
    steps["NumberOfParts"] = np.ones(count, np.int64)
    for name in ("PartOffsets", "PointOffsets"):
        steps[name] = np.zeros(count, np.int64)
    for name in ("CellOffsets", "ConnectivityIdOffsets"):
        steps[name] = np.zeros((count, 1), np.int64)
    for number in range(count):
        state: ViewedState = read(file, number)
        if number == 0:
            m, columns = state.cells.shape
            root["NumberOfPoints"], root["NumberOfCells"] = [len(state.points)], [m]
            root["NumberOfConnectivityIds"] = [m * columns]
            root["Points"], root["Connectivity"] = state.points, state.cells.ravel().astype(np.int64)
            root["Offsets"] = columns * np.arange(m + 1)
            root["Types"] = np.full(m, KINDS[columns], np.uint8)
        for group, arrays in (("PointData", state.nodes), ("CellData", state.elements)):
            _append(root.require_group(group), steps.require_group(f"{group}Offsets"), arrays, number, count)


def _append(group: Any, offsets: Any, arrays: Mapping[str, Array], number: int, count: int) -> None:
    """Write the arrays of one of so many states behind those of the states before it."""
    for name, array in arrays.items():
        rows = len(array)
        if number == 0:
            group.create_dataset(name, (rows * count, *array.shape[1:]), array.dtype)
            offsets[name] = rows * np.arange(count)
        group[name][number * rows : (number + 1) * rows] = array
