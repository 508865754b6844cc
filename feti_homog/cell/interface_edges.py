"""Which edges of a mesh are interfaces on the torus."""

from __future__ import annotations

import numpy as np

from feti_homog.cell.coarse_mesh import CoarseMesh, edge_keys, edges
from feti_homog.cell.periodic_sides import paired_sides
from feti_homog.typing import Bool, Index, Int32


def interface_edges(mesh: CoarseMesh) -> Int32:
    """Edges (k, 2) between triangles of different phases on the torus; of those on sides the low copy."""
    pairs, order = _neighbours(mesh)
    between = mesh.phase[order[:, 0] // 3] != mesh.phase[order[:, 1] // 3]
    return np.asarray(pairs[order[between, 0]])


def can_debond(mesh: CoarseMesh, pairs: Int32) -> Bool:
    """Whether edges (k, 2) are between a fibre and the matrix on the torus; either copy on sides."""
    own, order = _neighbours(mesh)
    in_matrix = mesh.phase[order // 3] == 0
    between = own[order[in_matrix[:, 0] != in_matrix[:, 1], 0]]
    n = len(mesh.points)
    return np.isin(edge_keys(_low_copies(mesh, pairs), n), edge_keys(between, n))


def _neighbours(mesh: CoarseMesh) -> tuple[Int32, Index]:
    """The triangles' edges (3m, 2), low copies on sides, and the two places (e, 2) of each of them."""
    pairs = _low_copies(mesh, edges(mesh.triangles))
    return pairs, np.argsort(edge_keys(pairs, len(mesh.points)), kind="stable").reshape(-1, 2)


def _low_copies(mesh: CoarseMesh, pairs: Int32) -> Int32:
    """Edges (k, 2), those on the right or upper side moved to the opposite one."""
    for axis, low, high in paired_sides(mesh.points, mesh.period):
        partner = np.zeros(len(mesh.points), dtype=np.int32)
        partner[high] = low
        on_high = np.all(mesh.points[pairs, axis] == mesh.period[axis], axis=1)
        pairs = np.where(on_high[:, None], partner[pairs], pairs)
    return pairs
