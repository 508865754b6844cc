"""Write result.xdmf and interface.xdmf, which let ParaView read result.h5.

The files use only features that all XDMF readers of ParaView and VTK support: whole datasets, points with a
connectivity, tensors with nine components, one temporal collection per file.  Readers load no strings.  A state label
therefore is the name of a block, which two readers show, and an array of bytes, with the same length in all states.
"""

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import h5py
import numpy as np

from feti_homog.materials import voigt
from feti_homog.results import atomic, field_file
from feti_homog.results.field_layout import AXIAL, StatePart, tables
from feti_homog.typing import Float

CELL, INTERFACE = "result.xdmf", "interface.xdmf"
TENSOR = np.array([0, 5, 4, 5, 1, 3, 4, 3, 2])  # tensor rows, as indices into [11, 22, 33, 23, 13, 12]
NUMBERS = {"f": "Float", "i": "Int"}
SHAPES = {1: "Scalar", 3: "Vector", 9: "Tensor"}  # by the number of components
# Arrays of the cell and the interface, each with its dataset in result.h5; K stands for a state.
CELL_NODES = {"displacement": "vector/state/K/displacement"}
CELL_ELEMENTS = {
    **{name: f"mesh/{name}" for name in ("body", "fibre_number", "phase", "subdomain")},
    "stress": "tensor/state/K/stress",
    **{name: f"column/state/K/{name}" for name in voigt.STRESSES},
    "S33": "state/K/stress_33",
}
INTERFACE_POINTS = {
    "displacement": "state/K/displacement_fibre",
    "displacement_matrix": "state/K/displacement_matrix",
    "traction": "state/K/traction_vector",
    "jump": "state/K/jump_vector",
    **{name: f"column/state/K/{name}" for name in ("traction_n", "traction_t", "jump_n", "jump_t")},
    "status": "state/K/status",
    "normal": "vector/interface/normal",
    **{name: f"interface/{name}" for name in ("length", "fibre", "fibre_number", "pair")},
}
# Further arrays in generalized plane strain and conduction.
SPATIAL_ELEMENTS = {name: f"column/state/K/{name}" for name in voigt.AXIAL_STRESSES}
SPATIAL_POINTS = {f"{name}_a": f"state/K/axial_{name}" for name in ("traction", "jump")}
LISTED = {*CELL_ELEMENTS.values(), *INTERFACE_POINTS.values(), *SPATIAL_POINTS.values()}


def _described(*shapes: str) -> dict[str, str]:
    """Return the datasets of state fields with a shape in `shapes`, by field name, except LISTED datasets."""
    fields = {name: d.shape for name, d in tables(StatePart).items() if f"state/K/{name}" not in LISTED}
    return {name: f"state/K/{name}" for name, shape in fields.items() if shape in shapes}


CELL_ELEMENTS |= _described("(m,)")
INTERFACE_POINTS |= _described("(k,)", "(k, 3)")


def write(directory: Path) -> list[Path]:
    """Write the XDMF files for `directory`/result.h5; return their paths.  Call on one rank.

    result.xdmf has the fields on nodes and elements of the cell.  A cell with interface nodes also gets interface.xdmf,
    with the fields at interface points.  Each file has one temporal collection, with state numbers as times.  Raises
    FetiHomogError if result.h5 cannot be read or a file cannot be written.
    """
    h5, paths = Path(directory) / field_file.NAME, list[Path]()
    with atomic.file_errors("write", Path(directory) / CELL), h5py.File(h5, "r", locking=False) as file:
        states = sorted(file.get("state", ()), key=int)
        labels = [str(file[f"state/{state}"].attrs["label"]) for state in states]
        longest = max((len(label.encode()) for label in labels), default=0)
        for name in (CELL, INTERFACE) if len(file["interface/points"]) else (CELL,):
            root = ET.Element("Xdmf", Version="3.0")
            form = {"Name": "cell" if name == CELL else "interface", "GridType": "Collection"}
            collection = ET.SubElement(ET.SubElement(root, "Domain"), "Grid", form, CollectionType="Temporal")
            for state, label in zip(states, labels, strict=True):
                # One collection for each state: readers show grid names only inside a spatial collection.
                kind = {"Name": f"state {state}", "GridType": "Collection", "CollectionType": "Spatial"}
                block = ET.SubElement(collection, "Grid", kind)
                ET.SubElement(block, "Time", Value=state)
                grid = ET.SubElement(block, "Grid", Name=label, GridType="Uniform")
                _numbers(grid, "label", "Scalar", list(label.encode().ljust(longest)))
                for mean, values in cell_means(file[f"state/{state}"].attrs).items():
                    _numbers(grid, mean, SHAPES[values.size], values.ravel().tolist())
                is_spatial = AXIAL in file[f"state/{state}"]
                if name == CELL:
                    triangles = "Triangle_6" if file["mesh/triangles"].shape[1] == 6 else "Triangle"
                    _mesh(grid, {"TopologyType": triangles}, file["mesh/triangles"], file["mesh/points"])
                    _attributes(grid, file, state, CELL_NODES, "Node")
                    _attributes(grid, file, state, CELL_ELEMENTS | (SPATIAL_ELEMENTS if is_spatial else {}), "Cell")
                else:
                    vertices = {"TopologyType": "Polyvertex", "NodesPerElement": "1"}
                    _mesh(grid, vertices, file["interface/vertex"], file["interface/points"])
                    _attributes(grid, file, state, INTERFACE_POINTS | (SPATIAL_POINTS if is_spatial else {}), "Node")
            ET.indent(root)
            write_tree = partial(ET.ElementTree(root).write, encoding="utf-8", xml_declaration=True)
            paths.append(atomic.replace(h5.with_name(name), write_tree))
    return paths


def cell_means(attributes: Mapping[str, Any]) -> dict[str, Float]:
    """Return rows (1, c), by name, from the attributes of a state: load factor, mean strain and mean stress.

    Plane states have vectors with gamma12; other states have tensors (c = 9) with E12, and the temperature.
    """
    names, strain, stress = ["load_factor"], attributes["strain"], attributes["stress"]
    if "temperature" in attributes:
        names.append("temperature")
        strain, stress = strain[TENSOR] * np.where(TENSOR < 3, 1.0, 0.5), stress[TENSOR]
    numbers = {name: np.array([[attributes[name]]], float) for name in names}
    return numbers | {"mean_strain": strain[None], "mean_stress": stress[None]}


def _numbers(grid: ET.Element, name: str, kind: str, values: Sequence[float]) -> None:
    """Add to a grid an attribute of the state as a whole, whose values stand in the XML text."""
    size = f"1 {len(values)}" if kind != "Scalar" else str(len(values))
    number, precision = ("Float", "8") if isinstance(values[0], float) else ("Int", "4")
    item = ET.Element("DataItem", Dimensions=size, Format="XML", NumberType=number, Precision=precision)
    item.text = " ".join(map(repr, values))
    ET.SubElement(grid, "Attribute", Name=name, AttributeType=kind, Center="Grid").append(item)


def _mesh(grid: ET.Element, kind: dict[str, str], connectivity: Any, points: Any) -> None:
    topology = ET.SubElement(grid, "Topology", kind, NumberOfElements=str(len(connectivity)))
    topology.append(_table(connectivity))
    ET.SubElement(grid, "Geometry", GeometryType="XY").append(_table(points))


def _attributes(grid: ET.Element, file: h5py.File, state: str, arrays: Mapping[str, str], centre: str) -> None:
    """Add to a grid an attribute, at nodes or cells (`centre`), for each dataset of a state in `arrays`."""
    for name, dataset in arrays.items():
        table = file[dataset.replace("/K/", f"/{state}/")]
        kind = SHAPES[1 if table.ndim == 1 else table.shape[1]]
        ET.SubElement(grid, "Attribute", Name=name, AttributeType=kind, Center=centre).append(_table(table))


def _table(table: Any) -> ET.Element:
    """Construct the XML element that refers to a whole dataset of result.h5."""
    number = "Char" if table.dtype == np.int8 else NUMBERS[table.dtype.kind]
    form = {"Format": "HDF", "NumberType": number, "Precision": str(table.dtype.itemsize)}
    item = ET.Element("DataItem", form, Dimensions=" ".join(map(str, table.shape)))
    item.text = f"{field_file.NAME}:{table.name}"
    return item
