"""Edges of a mesh that are interfaces on the torus, between phases or beside voids."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from feti_homog.mesh.coarse_mesh import CoarseMesh, edge_keys, edges, paired_sides
from feti_homog.typing import Bool, Index, Int32


def interface_edges(mesh: CoarseMesh) -> Int32:
    """Edges (k, 2) between triangles of different phases, or beside a void, on the torus.

    Of those on sides the low copy.
    """
    pairs, order = _neighbours(mesh)
    between = mesh.phase[order[:, 0] // 3] != mesh.phase[order[:, 1] // 3]
    return np.concatenate([pairs[order[between, 0]], pairs[_alone(pairs, order)]])


def void_edges(mesh: CoarseMesh) -> Int32:
    """Edges (k, 2) that one triangle has on the torus: a void is on the other side; of those on sides the low copy."""
    pairs, order = _neighbours(mesh)
    return np.asarray(pairs[_alone(pairs, order)])


def voids(mesh: CoarseMesh) -> int:
    """Count the connected boundaries of voids on the torus."""
    pairs = mesh.representative[void_edges(mesh)]
    classes, ends = np.unique(pairs, return_inverse=True)
    ends = ends.reshape(-1, 2)
    graph = coo_matrix((np.ones(len(ends)), tuple(ends.T)), shape=(len(classes),) * 2)
    return int(connected_components(graph, directed=False)[0])


def can_debond(mesh: CoarseMesh, pairs: Int32) -> Bool:
    """Return whether edges (k, 2) are between a fibre and the matrix on the torus; either copy on sides."""
    own, order = _neighbours(mesh)
    in_matrix = mesh.phase[order // 3] == 0
    between = own[order[in_matrix[:, 0] != in_matrix[:, 1], 0]]
    n = len(mesh.points)
    return np.isin(edge_keys(_low_copies(mesh, pairs), n), edge_keys(between, n))


def _neighbours(mesh: CoarseMesh) -> tuple[Int32, Index]:
    """Return the triangles' edges (3m, 2), low copies on sides, and the two places (e, 2) of those that have two."""
    pairs = _low_copies(mesh, edges(mesh.triangles))
    keys = edge_keys(pairs, len(mesh.points))
    order = np.argsort(keys, kind="stable")
    twice = np.flatnonzero(keys[order][1:] == keys[order][:-1])
    return pairs, np.stack([order[twice], order[twice + 1]], axis=1)


def _alone(pairs: Int32, order: Index) -> Bool:
    """Return which of the edges of `_neighbours` (3m, 2) no other triangle has."""
    alone = np.ones(len(pairs), bool)
    alone[order] = False
    return alone


def _low_copies(mesh: CoarseMesh, pairs: Int32) -> Int32:
    """Edges (k, 2), those on the right or upper side moved to the opposite one."""
    for axis, low, high in paired_sides(mesh.points, mesh.period):
        partner = np.zeros(len(mesh.points), dtype=np.int32)
        partner[high] = low
        on_high = np.all(mesh.points[pairs, axis] == mesh.period[axis], axis=1)
        pairs = np.where(on_high[:, None], partner[pairs], pairs)
    return pairs
