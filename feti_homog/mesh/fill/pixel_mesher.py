"""The coarse mesh of a label image: two triangles a pixel, or regions within smooth outlines."""

import numpy as np

from feti_homog.case import cell_section
from feti_homog.errors import MeshError
from feti_homog.mesh.coarse_mesh import CoarseMesh
from feti_homog.mesh.periodic_topology import components, present
from feti_homog.mesh.readers import msh_reader
from feti_homog.mesh.readers.raw_mesh import HALVES
from feti_homog.microstructure import label_image, phase_names
from feti_homog.microstructure.shapes import Ellipses
from feti_homog.typing import Int, Int32


def read_cell(cell: cell_section.Cell) -> CoarseMesh:
    """Read the mesh file or the image of a cell.

    Each pixel is cut in two triangles, as `raw_mesh.in_triangles` cuts a grid of quadrilaterals.

    Raises:
        CaseError, MeshError: as `msh_reader.read`, `label_image.read_labels` and `contour_mesher.mesh_contours`.
    """
    assert cell.file is not None
    if cell.geometry == "mesh":
        snap = cell.snap_tolerance if cell.repair == "snap" else None
        return msh_reader.read(cell.file, snap, cell.phases, bool(cell.voids), cell.boundary)
    phase, phases = label_image.read_labels(cell.file, cell.labels, cell.window == "mirrored")
    if cell.smooth:
        from feti_homog.mesh.fill import contour_mesher  # imports gmsh

        return contour_mesher.mesh_contours(phase, phases, cell)
    solid = _solid(phase, phases, cell)
    (rows, columns), n = phase.shape, phase.shape[1] + 1
    low = solid + solid // columns
    # Diagonals join nodes of an even sum of row and column.
    halves = HALVES.astype(np.int32)[(low // n + low % n) % 2]
    corners = (low[:, None] + [0, 1, n + 1, n]).astype(np.int32)
    nodes, triangles = present(np.take_along_axis(corners[:, None], halves, axis=2).reshape(-1, 3), n * (rows + 1))
    places, number = np.stack([nodes % n, nodes // n], axis=1), np.repeat(phase.ravel()[solid], 2)
    representative = np.arange(len(nodes), dtype=np.int32)
    if cell.boundary == "periodic":
        node_class, first = places % [columns, rows] @ [1, n], np.empty(n * rows, np.int32)
        first[node_class[::-1]] = representative[::-1]
        representative = first[node_class]
    return CoarseMesh(
        width=cell.pixel * columns,
        height=cell.pixel * rows,
        points=cell.pixel * places,
        triangles=triangles.astype(np.int32),
        phase=number,
        phases=tuple(name for name in phases if name != phase_names.VOID),
        precedence=number,
        representative=representative,
        ellipses=Ellipses.round(np.zeros((0, 3))),
        arc_edges=np.zeros((0, 2), np.int32),
        arc_circle=np.zeros(0, np.int32),
        debonded_edges=np.zeros((0, 2), np.int32),
        boundary=cell.boundary,
    )


def _solid(phase: Int32, phases: tuple[str, ...], cell: cell_section.Cell) -> Int:
    """Find the pixels (k,) outside voids among phases (rows, columns).

    Raises:
        MeshError: voids part some pixels from all others, or lie at sides with tractions.
    """
    is_solid = phase != (*phases, phase_names.VOID).index(phase_names.VOID)
    solid = np.flatnonzero(is_solid)
    if len(solid) == phase.size:
        return solid
    place = np.arange(phase.size).reshape(phase.shape)
    padded = np.pad(place, ((0, 1), (0, 1)), mode="wrap" if cell.boundary == "periodic" else "edge")
    one, other = np.tile(place.ravel(), 2), np.append(padded[1:, :-1], padded[:-1, 1:])
    joins = is_solid.ravel()[one] & is_solid.ravel()[other]
    part = components(phase.size, one[joins], other[joins])[solid]
    faults, sizes = [], np.bincount(part)
    for pixel in solid[part != sizes.argmax()][:1]:
        row, column = len(phase) - pixel // phase.shape[1], pixel % phase.shape[1] + 1
        where = f"that of {sizes[part[solid == pixel][0]]} pixels with the one in row {row}, column {column}"
        faults.append(f"floating parts, which voids part from all others: {where}; expected the label of a void there")
    sides = is_solid[[0, -1]].all() and is_solid[:, [0, -1]].all()
    if cell.boundary == "traction" and not sides:
        faults.append('voids at the sides, where boundary = "traction" has no material to pull at')
    if faults:
        raise MeshError(*(f"{cell.file and cell.file.name}: {fault}" for fault in faults))
    return solid
