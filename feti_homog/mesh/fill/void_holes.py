"""Voids of a cell that is meshed with them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from feti_homog.mesh.coarse_mesh import CoarseMesh, representatives


def without_voids(mesh: CoarseMesh, void: int) -> CoarseMesh:
    """The mesh without the triangles of the phase number `void`, which has no name in it, and without nodes that no
    other triangle has."""
    kept = mesh.phase != void
    used = np.zeros(len(mesh.points), bool)
    used[mesh.triangles[kept]] = True
    number = (np.cumsum(used) - 1).astype(np.int32)
    points = mesh.points[used]
    return replace(
        mesh,
        points=points,
        triangles=number[mesh.triangles[kept]],
        phase=mesh.phase[kept],
        precedence=mesh.precedence[kept],
        representative=representatives(points, mesh.width, mesh.height),
        arc_edges=number[mesh.arc_edges],
    )
