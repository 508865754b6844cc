"""result.xdmf: says where in result.h5 ParaView finds mesh, interface and states."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import h5py
import numpy as np

from feti_homog.mechanics.voigt import STRESSES
from feti_homog.output.files import atomic, field_file

NAME = "result.xdmf"
NUMBERS = {"f": "Float", "i": "Int"}


def write(directory: Path) -> Path:
    """Writes `directory`/result.xdmf for the result.h5 beside it; returns its path. Call on one rank.

    Two temporal collections, the time being the number of the state: "cell" with the fields on nodes and
    elements and, if there are interface nodes, "interface" with those at its points.

    Raises:
        FetiHomogError: result.h5 cannot be read or the file cannot be written.
    """
    path = Path(directory) / NAME
    root = ET.Element("Xdmf", Version="3.0")
    domain = ET.SubElement(root, "Domain")
    with atomic.write_errors(path), h5py.File(path.with_name(field_file.NAME), "r") as file:
        states = sorted(file.get("state", ()), key=int)
        _collection(domain, "cell", [_cell(file, state) for state in states])
        if len(file["interface/points"]):
            _collection(domain, "interface", [_interface(file, state) for state in states])
    ET.indent(root)
    return atomic.replace(path, lambda part: ET.ElementTree(root).write(part, encoding="utf-8", xml_declaration=True))


def _collection(domain: ET.Element, name: str, grids: list[ET.Element]) -> None:
    collection = ET.SubElement(domain, "Grid", Name=name, GridType="Collection", CollectionType="Temporal")
    collection.extend(grids)


def _cell(file: h5py.File, state: str) -> ET.Element:
    grid = _grid("cell", state)
    triangles = file["mesh/triangles"]
    kind = "Triangle_6" if triangles.shape[1] == 6 else "Triangle"
    topology = ET.SubElement(grid, "Topology", TopologyType=kind, NumberOfElements=str(len(triangles)))
    topology.append(_table(triangles))
    _points(grid, file["mesh/points"])
    for name in ("displacement", "fluctuation"):
        _attribute(grid, name, "Vector", "Node", _table(file[f"vector/state/{state}/{name}"]))
    for name in ("body", "subdomain", "phase"):
        _attribute(grid, name, "Scalar", "Cell", _table(file[f"mesh/{name}"]))
    for column, name in enumerate(STRESSES):
        _attribute(grid, name, "Scalar", "Cell", _column(file[f"state/{state}/stress"], column))
    return grid


def _interface(file: h5py.File, state: str) -> ET.Element:
    grid = _grid("interface", state)
    points = file["interface/points"]
    topology = {"TopologyType": "Polyvertex", "NumberOfElements": str(len(points)), "NodesPerElement": "1"}
    ET.SubElement(grid, "Topology", topology)
    _points(grid, points)
    _attribute(grid, "normal", "Vector", "Node", _table(file["vector/interface/normal"]))
    for name in ("length", "fibre"):
        _attribute(grid, name, "Scalar", "Node", _table(file[f"interface/{name}"]))
    for name in ("traction", "jump"):
        for column, direction in enumerate("nt"):
            values = _column(file[f"state/{state}/{name}"], column)
            _attribute(grid, f"{name}_{direction}", "Scalar", "Node", values)
    _attribute(grid, "status", "Scalar", "Node", _table(file[f"state/{state}/status"]))
    return grid


def _grid(name: str, state: str) -> ET.Element:
    grid = ET.Element("Grid", Name=name, GridType="Uniform")
    ET.SubElement(grid, "Time", Value=state)
    return grid


def _points(grid: ET.Element, points: Any) -> None:
    ET.SubElement(grid, "Geometry", GeometryType="XY").append(_table(points))


def _attribute(grid: ET.Element, name: str, kind: str, center: str, values: ET.Element) -> None:
    ET.SubElement(grid, "Attribute", Name=name, AttributeType=kind, Center=center).append(values)


def _table(table: Any) -> ET.Element:
    """A whole dataset of result.h5."""
    number = "Char" if table.dtype == np.int8 else NUMBERS[table.dtype.kind]
    form = {"Format": "HDF", "NumberType": number, "Precision": str(table.dtype.itemsize)}
    item = ET.Element("DataItem", form, Dimensions=" ".join(map(str, table.shape)))
    item.text = f"{field_file.NAME}:{table.name}"
    return item


def _column(table: Any, column: int) -> ET.Element:
    """One column of a dataset: start, stride and count of the hyperslab."""
    item = ET.Element("DataItem", ItemType="HyperSlab", Dimensions=f"{len(table)} 1")
    slab = ET.SubElement(item, "DataItem", Dimensions="3 2", Format="XML")
    slab.text = f"0 {column} 1 1 {len(table)} 1"
    item.append(_table(table))
    return item
