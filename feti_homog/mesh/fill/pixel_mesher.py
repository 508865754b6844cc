"""Make the coarse mesh of a label image: from its pixels, or from regions within smooth outlines."""

import numpy as np

from feti_homog.case import cell_section
from feti_homog.errors import MeshError
from feti_homog.mesh.coarse_mesh import CoarseMesh
from feti_homog.mesh.periodic_topology import Torus, components, present
from feti_homog.mesh.readers import msh_reader
from feti_homog.microstructure import label_image, phase_names
from feti_homog.typing import Bool


def read_cell(cell: cell_section.Cell, materials: tuple[str, ...] = ()) -> CoarseMesh:
    """Read the mesh file of a cell, or mesh its image: pixels as elements or, with `cell.smooth`, triangles.

    Messages propose the phases in `materials`.  Raises CaseError and MeshError as `msh_reader.read`,
    `label_image.read_labels` and `contour_mesher.mesh_contours` do; also if voids separate pixels from all others, or
    lie at sides with tractions.
    """
    assert cell.file is not None
    if cell.geometry == "mesh":
        snap = cell.snap_tolerance if cell.repair == "snap" else None
        return msh_reader.read(cell.file, snap, cell.phases, bool(cell.voids), cell.boundary, materials, cell.order)
    phase, phases = label_image.read_labels(cell.file, cell.labels, cell.window == "mirrored")
    if cell.smooth:
        from feti_homog.mesh.fill import contour_mesher  # imports gmsh

        return contour_mesher.mesh_contours(phase, phases, cell)
    is_solid = phase != (*phases, phase_names.VOID).index(phase_names.VOID)
    solid, (rows, columns), n = np.flatnonzero(is_solid), phase.shape, phase.shape[1] + 1  # n: nodes in a row
    corners = (solid + solid // columns)[:, None] + [0, 1, n + 1, n]
    nodes, elements = present(corners, n * (rows + 1))
    places, number = np.stack([nodes % n, nodes // n], axis=1), phase[is_solid]
    representative = np.arange(len(nodes), dtype=np.int32)
    if cell.boundary == "periodic":
        node_class, first = places % [columns, rows] @ [1, n], np.empty(n * rows, np.int32)
        first[node_class[::-1]] = representative[::-1]
        representative = first[node_class]
    mesh = CoarseMesh(
        width=cell.pixel * columns,
        height=cell.pixel * rows,
        points=cell.pixel * places,
        triangles=elements.astype(np.int32),
        phase=number,
        phases=tuple(name for name in phases if name != phase_names.VOID),
        precedence=number,
        representative=representative,
        boundary=cell.boundary,
    )
    if faults := [] if is_solid.all() else _void_faults(mesh, is_solid):
        raise MeshError(*(f"{cell.file.name}: {fault}" for fault in faults))
    return mesh


def _void_faults(mesh: CoarseMesh, is_solid: Bool) -> list[str]:
    """List faults: the first part that voids cut off, and voids at sides with tractions; `is_solid` (rows, columns)."""
    solid, (rows, columns) = np.flatnonzero(is_solid), is_solid.shape
    part = components(len(solid), *Torus.of(mesh).sides[:2])
    faults, sizes = [], np.bincount(part)
    for k in np.flatnonzero(part != sizes.argmax())[:1]:
        where = f"{sizes[part[k]]} pixels around row {rows - solid[k] // columns}, column {solid[k] % columns + 1}"
        line = "floating parts, separated from all others by voids: the part of"
        faults.append(f"{line} {where}; expected the label of a void there")
    if mesh.boundary == "traction" and not (is_solid[[0, -1]].all() and is_solid[:, [0, -1]].all()):
        faults.append('voids at the sides, where boundary = "traction" has no material to pull at')
    return faults
