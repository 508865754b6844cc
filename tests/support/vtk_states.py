"""States of a file by VTK's reader of XDMF, each with its mesh and all of its arrays."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline
from vtkmodules.vtkIOXdmf2 import vtkXdmfReader


@dataclass(frozen=True)
class ViewedState:
    """A state as ParaView has it; arrays by name, `grid` being those of the state as a whole."""

    time: float
    label: str
    points: np.ndarray
    cells: np.ndarray
    cell_types: set[int]
    nodes: dict[str, np.ndarray]
    elements: dict[str, np.ndarray]
    grid: dict[str, np.ndarray]


def viewed_states(path: Path) -> Iterator[ViewedState]:
    """Yield the states of a file, one after the other."""
    reader = vtkXdmfReader()
    reader.SetFileName(str(path))
    reader.UpdateInformation()
    for time in reader.GetOutputInformation(0).Get(vtkStreamingDemandDrivenPipeline.TIME_STEPS()):
        reader.UpdateTimeStep(time)
        blocks = reader.GetOutputDataObject(0)
        assert blocks.GetNumberOfBlocks() == 1
        data = blocks.GetBlock(0)
        cells = vtk_to_numpy(data.GetCells().GetConnectivityArray()).reshape(data.GetNumberOfCells(), -1)
        yield ViewedState(
            time=time,
            label=blocks.GetMetaData(0).Get(blocks.NAME()),
            points=vtk_to_numpy(data.GetPoints().GetData()),
            cells=cells,
            cell_types={data.GetCellType(i) for i in range(data.GetNumberOfCells())},
            nodes=_arrays(data.GetPointData()),
            elements=_arrays(data.GetCellData()),
            grid=_arrays(data.GetFieldData()),
        )


def _arrays(attributes: Any) -> dict[str, np.ndarray]:
    found = [attributes.GetArray(i) for i in range(attributes.GetNumberOfArrays())]
    return {array.GetName(): vtk_to_numpy(array).copy() for array in found}
