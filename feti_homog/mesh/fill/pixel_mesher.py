"""The coarse mesh of a label image: two triangles a pixel, or regions within smooth outlines."""

from dataclasses import replace

import numpy as np

from feti_homog.case import cell_section
from feti_homog.mesh.coarse_mesh import CoarseMesh, representatives
from feti_homog.mesh.readers import msh_reader
from feti_homog.mesh.readers.raw_mesh import HALVES
from feti_homog.microstructure import label_image
from feti_homog.microstructure.shapes import Ellipses


def read_cell(cell: cell_section.Cell) -> CoarseMesh:
    """Read the mesh file or the image of a cell.

    Each pixel is cut in two triangles, as `raw_mesh.in_triangles` cuts a grid of quadrilaterals.

    Raises:
        CaseError, MeshError: as `msh_reader.read_cell`, `label_image.read_labels` and `contour_mesher.mesh_contours`.
    """
    if cell.geometry == "mesh":
        return msh_reader.read_cell(cell)
    assert cell.file is not None
    phase, phases = label_image.read_labels(cell.file, cell.labels, cell.window == "mirrored")
    if cell.smooth:
        from feti_homog.mesh.fill import contour_mesher  # imports gmsh

        return contour_mesher.mesh_contours(phase, phases, cell)
    rows, columns = phase.shape
    n = columns + 1
    low = (np.arange(rows)[:, None] * n + np.arange(columns)).ravel()
    corners = (low[:, None] + [0, 1, n + 1, n]).astype(np.int32)
    y, x = cell.pixel * np.arange(rows + 1), cell.pixel * np.arange(n)
    points, number = np.column_stack([np.tile(x, rows + 1), np.repeat(y, n)]), np.repeat(phase.ravel(), 2)
    # Diagonals join nodes of an even sum of row and column.
    halves = HALVES.astype(np.int32)[(low // n + low % n) % 2]
    mesh = CoarseMesh(
        width=float(x[-1]),
        height=float(y[-1]),
        points=points,
        triangles=np.take_along_axis(corners[:, None], halves, axis=2).reshape(-1, 3),
        phase=number,
        phases=phases,
        precedence=number,
        representative=np.arange(len(points)),
        ellipses=Ellipses.round(np.zeros((0, 3))),
        arc_edges=np.zeros((0, 2), np.int32),
        arc_circle=np.zeros(0, np.int32),
        debonded_edges=np.zeros((0, 2), np.int32),
        boundary=cell.boundary,
    )
    return replace(mesh, representative=representatives(points, *mesh.shift))
