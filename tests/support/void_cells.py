"""Meshes with voids: cells of the program with some fibres left out, as files that a user brings."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

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


def write_part(path: Path, mesh: CoarseMesh, kept: Bool) -> None:
    """Write the file of the triangles of a mesh that are `kept` (m,)."""
    triangles, phase = mesh.triangles[kept], mesh.phase[kept]
    names = [f'2 {number + 1} "{name}"' for number, name in enumerate(mesh.phases) if (phase == number).any()]
    used = np.unique(triangles)
    nodes = [f"{n + 1} {mesh.points[n, 0]!r} {mesh.points[n, 1]!r} 0" for n in used.tolist()]
    nodes = [line.replace("np.float64(", "").replace(")", "") for line in nodes]
    elements = [
        f"{k + 1} 2 2 {p + 1} {p + 1} {a + 1} {b + 1} {c + 1}"
        for k, (p, (a, b, c)) in enumerate(zip(phase.tolist(), triangles.tolist(), strict=True))
    ]
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$PhysicalNames", str(len(names)), *names]
    lines += ["$EndPhysicalNames", "$Nodes", str(len(nodes)), *nodes, "$EndNodes", "$Elements", str(len(elements))]
    path.write_text("\n".join([*lines, *elements, "$EndElements", ""]))
