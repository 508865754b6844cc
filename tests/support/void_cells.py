"""Meshes of cells of the program as files that a user brings, with some fibres left out or phases renamed."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from unit.mesh.faulty_meshes import MshFile

from feti_homog.case.cell_section import Cell
from feti_homog.mesh.coarse_mesh import CoarseMesh
from feti_homog.typing import Bool
from support.generated_meshes import generate


def write_voids(path: Path, voids: Sequence[int] | None = None, **cell) -> None:
    """Write the mesh of a cell without the circles numbered `voids`, or any of them, and periodic images of these."""
    mesh = generate(Cell(**({"geometry": "square", "fibre_fraction": 0.4, "mesh_size": 0.15} | cell)), {})
    centres = mesh.points[mesh.triangles].mean(axis=1)
    kept = mesh.phase == 0
    if voids is not None:
        away = centres[:, None] - mesh.ellipses.circles[np.array(voids, int), :2]
        away -= np.round(away / mesh.period) * mesh.period
        kept = (np.hypot(*np.moveaxis(away, 2, 0)) > mesh.ellipses.circles[np.array(voids, int), 2]).all(axis=1)
    write_part(path, mesh, kept)


def write_part(path: Path, mesh: CoarseMesh, kept: Bool, phases: Sequence[str] = ()) -> None:
    """Write the file of the triangles of a mesh that are `kept` (m,), with other names of its phases, if given."""
    tags = {name: tag for tag, name in enumerate(dict.fromkeys(phases or mesh.phases), start=1)}
    physical = [tags[(phases or mesh.phases)[k]] for k in mesh.phase[kept]]
    corners = (mesh.triangles[kept] + 1).tolist()
    elements = {k + 1: (2, tag, tag, tuple(corners[k])) for k, tag in enumerate(physical)}
    nodes = {n: (*mesh.points[n - 1], 0.0) for n in np.unique(corners).tolist()}
    MshFile(nodes, elements, {tag: name for name, tag in tags.items() if tag in physical}).write(path)


def write_rings(path: Path, core: str, ring: str) -> None:
    """Write the mesh of a square cell whose fibre has the phase `core`, and `ring` in a ring around it."""
    mesh = generate(Cell(geometry="square", fibre_fraction=0.2, coating=0.4, mesh_size=0.12), {})
    write_part(path, mesh, mesh.phase >= 0, [{"fibre": core, "coating": ring}.get(name, name) for name in mesh.phases])
