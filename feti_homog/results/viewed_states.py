"""Read the states of result.h5 with derived fields, and write them as VTK files.

The formats are .vtu, with one file for each state, and .vtkhdf, with all states in one file: https://docs.vtk.org/en/latest/vtk_file_formats.
"""

import base64
import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import h5py
import numpy as np

from feti_homog.errors import CaseError
from feti_homog.fem import AXIAL, PLANE, assembly
from feti_homog.materials import voigt
from feti_homog.results import atomic, field_file, field_guard, xdmf
from feti_homog.results.field_layout import AXIAL as AXIAL_DISPLACEMENT
from feti_homog.typing import Array, Float
from feti_homog.verify import constitutive_law


@dataclass(frozen=True, repr=False)
class ViewedState:
    """One state on the elements of the cell or at the interface nodes, as arrays for a viewer.

    Attributes:
        points: (n, 3) positions of cell or interface nodes; cell nodes are torn between subdomains.
        cells: (m, 3 or 6) triangle nodes, mid-side nodes last; for an interface (k, 1) its nodes.
        nodes, elements: arrays by name, with (n, ...) and (m, ...) rows; vectors have three columns, tensors nine.
        means: rows (1, c) from `xdmf.cell_means`: load_factor, mean_strain, mean_stress and, in space, temperature.
        label: state label.
    """

    points: Float
    cells: Array
    nodes: Mapping[str, Array]
    elements: Mapping[str, Array]
    means: Mapping[str, Float]
    label: str

    def __repr__(self) -> str:
        return f"ViewedState({self.label!r}, {len(self.points)} nodes, {len(self.cells)} cells)"


def read_state(out: str | Path, number: int = 0) -> ViewedState:
    """Read a cell state from a result folder.  Call on one rank.

    `nodes` has displacement and fluctuation, the periodic part of the displacement (length).  `elements` has element
    means: the tensors stress and strain; S11, S22, S12, S33, in space S23 and S13, von_mises, and principal_1 to
    principal_3, largest first (stress); body, fibre_number, phase, subdomain and mesh_error.  Strains include thermal
    strains.  A value is NaN if the material constants do not determine it; mesh_error is NaN without an estimate.

    Raises:
        CaseError: result.h5 is missing or damaged, or has no such state.
        FetiHomogError: result.h5 has no read permission.
    """
    path = Path(out) / field_file.NAME
    field_guard.require_own(path, number)
    with h5py.File(path, "r", locking=False) as file:
        count = len(file.get("state", ()))
        if not 0 <= number < count:
            raise CaseError(f"{path}: has no state {number}: its {count} states are numbered from 0")
        return cell_state(file, number)


def cell_state(file: Any, state: int) -> ViewedState:
    """Read the cell in state number `state` from an open result.h5, with the fields that `read_state` names."""
    group = file[f"state/{state}"]
    is_spatial, strain = AXIAL_DISPLACEMENT in group, group.attrs["strain"]
    nodes = _tables(file, state, xdmf.CELL_NODES)
    elements = _tables(file, state, xdmf.CELL_ELEMENTS | (xdmf.SPATIAL_ELEMENTS if is_spatial else {}))
    points, triangles = file["mesh/points"][()], file["mesh/triangles"][()]
    # The macroscopic strain causes the displacement H x, in the plane and along the fibres.
    along = strain[[4, 3]] if is_spatial else np.zeros(2)  # gamma13, gamma23
    gradient = np.vstack([PLANE.gradient(strain[[0, 1, -1]]), AXIAL.gradient(along)])
    nodes["fluctuation"] = nodes["displacement"] - (points - points.min(axis=0)) @ gradient.T
    in_plane = group["stress"][()]
    if is_spatial:
        E33 = np.full(len(in_plane), strain[2])
    else:  # from the constitutive laws, in plane strain and plane stress
        rules = constitutive_law.out_of_plane(json.loads(file.attrs["case"]), tuple(map(str, file.attrs["phases"])))
        E33 = np.einsum("ei,ei->e", rules[file["mesh/phase"][()], 1], in_plane)
    displacement = nodes["displacement"]
    E11, E22, gamma12 = assembly.element_strain(points, triangles, displacement[:, :2], PLANE).T
    gamma13, gamma23 = assembly.element_strain(points, triangles, displacement[:, 2:], AXIAL).T
    E12, E13, E23 = gamma12 / 2, gamma13 / 2, gamma23 / 2
    elements["strain"] = np.stack([E11, E12, E13, E12, E22, E23, E13, E23, E33], axis=1)
    shears = group["axial_stress"][()] if is_spatial else np.zeros((len(triangles), 2))
    S33 = elements["S33"]
    elements["von_mises"] = voigt.spatial_von_mises(in_plane, S33, shears)
    principal = voigt.spatial_principal(in_plane, S33, shears) if is_spatial else voigt.principal(in_plane, S33)
    elements |= {f"principal_{k + 1}": column for k, column in enumerate(principal.T)}
    means, in_space = xdmf.cell_means(group.attrs), np.pad(points, [(0, 0), (0, 1)])
    return ViewedState(in_space, triangles, nodes, elements, means, str(group.attrs["label"]))


def interface_state(file: Any, state: int) -> ViewedState:
    """Read the interface nodes in a state from an open result.h5: faces, tractions, jumps, bond states, geometry."""
    group = file[f"state/{state}"]
    places = xdmf.INTERFACE_POINTS | (xdmf.SPATIAL_POINTS if AXIAL_DISPLACEMENT in group else {})
    nodes, means = _tables(file, state, places), xdmf.cell_means(group.attrs)
    points = np.pad(file["interface/points"][()], [(0, 0), (0, 1)])
    return ViewedState(points, file["interface/vertex"][()], nodes, {}, means, str(group.attrs["label"]))


def _tables(file: Any, state: int, places: Mapping[str, str]) -> dict[str, Array]:
    """Read datasets of a state by name: `places` maps names to paths, in which /K/ stands for the state."""
    return {name: file[place.replace("/K/", f"/{state}/")][()] for name, place in places.items()}


KINDS = {1: 1, 3: 5, 6: 22}  # VTK's cell types, vertex and triangles, by number of nodes
TYPES = {"f4": "Float32", "f8": "Float64", "i1": "Int8", "i4": "Int32", "i8": "Int64", "u1": "UInt8"}
PARTS = {"cell": cell_state, "interface": interface_state}


def write_vtk(directory: Path, kind: str) -> list[Path]:
    """Write the states of `directory`/result.h5 in a VTK format; return the paths.  Call on one rank.

    `kind` is `vtu` or `vtkhdf`.  `vtu` writes cell_0000.vtu, ... and their list cell.pvd; `vtkhdf` writes cell.vtkhdf,
    with all states as steps.  A cell with interface nodes also has interface_0000.vtu, ... or interface.vtkhdf.  The
    time of a state is its number, since load factors may snap back; load factors and means are field data.

    Raises:
        CaseError: result.h5 is missing.
        FetiHomogError: result.h5 cannot be read, or a file cannot be written.
    """
    path = directory / field_file.NAME
    if not path.is_file():
        raise CaseError(f"{path}: it is missing; a run writes it with `fields = true` in [output]")
    with atomic.file_errors("read", path), h5py.File(path, "r", locking=False) as file:
        parts = {name: read for name, read in PARTS.items() if name == "cell" or len(file["interface/points"])}
        paths = list[Path]()
        for name, read in parts.items():
            if kind == "vtkhdf":
                paths.append(atomic.replace(directory / f"{name}.vtkhdf", partial(_write_vtkhdf, read, file)))
                continue
            collection = ET.Element("VTKFile", type="Collection", version="0.1")
            listed = ET.SubElement(collection, "Collection")
            for number in range(len(file.get("state", ()))):
                target = directory / f"{name}_{number:04d}.vtu"
                paths.append(atomic.replace(target, ET.ElementTree(_grid(read(file, number))).write))
                ET.SubElement(listed, "DataSet", timestep=str(number), file=target.name)
            paths.append(atomic.replace(directory / f"{name}.pvd", ET.ElementTree(collection).write))
        return paths


def _grid(state: ViewedState) -> ET.Element:
    """Convert a state to an XML tree in the format .vtu, with arrays in base64."""
    header = {"type": "UnstructuredGrid", "version": "1.0", "byte_order": "LittleEndian", "header_type": "UInt64"}
    root = ET.Element("VTKFile", header)
    m, columns = state.cells.shape
    sizes = {"NumberOfPoints": str(len(state.points)), "NumberOfCells": str(m)}
    grid = ET.SubElement(root, "UnstructuredGrid")
    whole, piece = ET.SubElement(grid, "FieldData"), ET.SubElement(grid, "Piece", sizes)
    cells = {
        "connectivity": state.cells.ravel(),
        "offsets": columns * np.arange(1, m + 1),
        "types": np.full(m, KINDS[columns], np.uint8),
    }
    groups = {"Points": {"Points": state.points}, "Cells": cells, "PointData": state.nodes, "CellData": state.elements}
    parents = {whole: state.means} | {ET.SubElement(piece, group): arrays for group, arrays in groups.items()}
    for parent, arrays in parents.items():
        for name, array in arrays.items():
            values = np.ascontiguousarray(array, array.dtype.newbyteorder("<"))
            width = {"NumberOfComponents": str(values.shape[1])} if values.ndim == 2 else {}
            form = {"type": TYPES[values.dtype.str[1:]], "Name": name, "format": "binary"}
            tuples = {"NumberOfTuples": "1"} if parent is whole else {}
            element = ET.SubElement(parent, "DataArray", form | width | tuples)
            element.text = base64.b64encode(np.uint64(values.nbytes).tobytes() + values.tobytes()).decode()
    return root


def _write_vtkhdf(read: Any, file: Any, path: Path) -> None:
    """Write all states to a .vtkhdf file, on the mesh of the first.  `read(file, number)` returns a `ViewedState`."""
    count, first = len(file.get("state", ())), read(file, 0)
    mesh = [first.points, *[first.cells.astype(np.int64)] * 2]  # the second for offsets and types
    of_state = [array for arrays in (first.means, first.nodes, first.elements) for array in arrays.values()]
    size = sum(array.nbytes for array in mesh) + count * sum(array.nbytes for array in of_state)
    field_file.create(path, size + len(of_state) * field_file.RESERVE)  # HDF5 crashes on a full disk
    with h5py.File(path, "r+") as out:
        root = out.create_group("VTKHDF")
        root.attrs["Version"] = np.array([2, 0])
        root.attrs.create("Type", b"UnstructuredGrid", dtype="S16")
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
            groups = {"FieldData": state.means, "PointData": state.nodes, "CellData": state.elements}
            for group, arrays in groups.items():
                tables, offsets = root.require_group(group), steps.require_group(f"{group}Offsets")
                for name, array in arrays.items():
                    rows = len(array)
                    if number == 0:
                        tables.create_dataset(name, (rows * count, *array.shape[1:]), array.dtype)
                        offsets[name] = rows * np.arange(count)
                    tables[name][number * rows : (number + 1) * rows] = array
