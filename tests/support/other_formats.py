"""Meshes as files of gmsh, Abaqus and VTK."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from unit.mesh.faulty_meshes import CURVE

from support.abaqus import write_inp

meshio = pytest.importorskip("meshio")


def written(mesh: Any, path: Path, **options: Any) -> Path:
    """Write an `MshFile` in the format of the suffix."""
    if path.suffix == ".msh":
        mesh.write(path)
        return path
    if path.suffix.lower() == ".inp":
        return write_inp(path, mesh)
    tags, kinds = sorted(mesh.nodes), {1: "line", 8: "line3", 2: "triangle", 3: "quad", 9: "triangle6"}
    cells, phases, debonded = [], [], []
    for kind in sorted({e[0] for e in mesh.elements.values()}):
        own = [mesh.elements[tag] for tag in sorted(mesh.elements) if mesh.elements[tag][0] == kind]
        cells.append((kinds[kind], np.searchsorted(tags, [e[3] for e in own])))
        is_line = kinds[kind].startswith("line")
        phases.append(np.array([0 if is_line else e[1] - 1 for e in own]))
        debonded.append(np.full(len(own), int(is_line and mesh.curves[CURVE] == "debonded")))
    data = {"phase": phases} | ({"debonded": debonded} if mesh.curves else {})
    meshio.Mesh(np.array([mesh.nodes[tag] for tag in tags]), cells, cell_data=data).write(path, **options)
    return path
