"""Files of VTK's own writers."""

from pathlib import Path
from typing import Any

import numpy as np
from unit.mesh.faulty_meshes import grid


def vtk_grid(kind: str = "int64", name: str = "phase", first: int = 0) -> Any:
    """Return the grid with normals that nobody needs, and its phases, numbered from `first`, of this type."""
    from vtkmodules.util.numpy_support import numpy_to_vtk
    from vtkmodules.vtkCommonCore import vtkPoints
    from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid

    data, points, elements = vtkUnstructuredGrid(), vtkPoints(), list(grid().elements.values())
    points.SetData(numpy_to_vtk(np.array(list(grid().nodes.values())), deep=True))
    data.SetPoints(points)
    for element in elements:
        data.InsertNextCell(5, 3, [n - 1 for n in element[3]])
    phases = np.array([e[1] - 1 + first for e in elements], kind)
    for own, values in (("quality", np.linspace(0, 1, 32)), (name, phases)):
        array = numpy_to_vtk(values, deep=True)
        array.SetName(own)
        data.GetCellData().AddArray(array)
    data.GetCellData().SetActiveScalars(name)
    return data


def write_vtu(path: Path, mode: str = "Appended base64", compressor: str = "ZLib", **settings: Any) -> Path:
    """Write the grid as an XML file."""
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridWriter

    writer = vtkXMLUnstructuredGridWriter()
    writer.SetFileName(str(path))
    writer.SetInputData(vtk_grid())
    getattr(writer, f"SetDataModeTo{mode.split()[0]}")()
    writer.SetEncodeAppendedData(mode.endswith("base64"))
    getattr(writer, f"SetCompressorTypeTo{compressor}")()
    for name, value in settings.items():
        getattr(writer, f"Set{name}")(value)
    writer.Write()
    return path


def write_vtk(path: Path, form: str, version: int, kind: str) -> Path:
    """Write the grid as a legacy file."""
    from vtkmodules.vtkIOLegacy import vtkUnstructuredGridWriter

    writer = vtkUnstructuredGridWriter()
    writer.SetFileName(str(path))
    writer.SetInputData(vtk_grid(kind))
    getattr(writer, f"SetFileTypeTo{form}")()
    writer.SetFileVersion(version)
    writer.Write()
    return path
