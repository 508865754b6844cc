"""Unwrapped positions of a subdomain: where its triangles lie when it is walked without jumps on the torus."""

from __future__ import annotations

from collections import deque

import numpy as np

from feti_homog.mesh.periodic_topology import components, edge_pairs
from feti_homog.mesh.submesh import Submesh
from feti_homog.typing import Float, Int


def unwrap(submesh: Submesh) -> tuple[Float, bool]:
    """Shift of each coarse triangle to its unwrapped position, and whether the walk closes.

    The walk closes when every class has one unwrapped position; then (and only then) the subdomain can
    rotate.  A piece that winds around the torus cannot.

    Returns:
        (t, 2) shifts, whole periods; true if the subdomain is contractible.
    """
    if len(submesh.class_keys) == len(submesh.points):
        # No two vertices are images of each other: the plane positions are unwrapped.
        return np.zeros((len(submesh.triangles), 2)), True
    part = components(len(submesh.triangles), *edge_pairs(submesh.triangle_edges))
    shift = _part_shifts(submesh, part)[part]
    corners = submesh.points[submesh.triangles] + shift[:, None]
    classes = submesh.vertex_class[submesh.triangles].ravel()
    position = np.empty((len(submesh.class_keys), 2))
    position[classes] = corners.reshape(-1, 2)
    closes = np.allclose(position[classes], corners.reshape(-1, 2), atol=1e-6 * submesh.period.min())
    return shift, closes


def _part_shifts(submesh: Submesh, part: Int) -> Float:
    """Shift of each plane-connected part, along a spanning tree of their contacts across the cell's boundary."""
    part_of_edge = np.empty(len(submesh.edges), np.int64)
    part_of_edge[submesh.triangle_edges] = part[:, None]
    order = np.argsort(submesh.edge_class, kind="stable")
    twice = np.flatnonzero(np.diff(submesh.edge_class[order]) == 0)
    a, b = order[twice], order[twice + 1]
    step = submesh.points[submesh.edges[a, 0]] - submesh.points[submesh.edges[b, 0]]
    links, first = np.unique(np.stack([part_of_edge[a], part_of_edge[b]], axis=1), axis=0, return_index=True)
    neighbours: dict[int, list[tuple[int, Float]]] = {k: [] for k in range(part.max() + 1)}
    for (p, q), k in zip(links.tolist(), first, strict=True):
        neighbours[p].append((q, step[k]))
        neighbours[q].append((p, -step[k]))
    shifts = np.full((part.max() + 1, 2), np.nan)
    shifts[0] = 0.0
    queue = deque([0])
    while queue:
        p = queue.popleft()
        for q, jump in neighbours[p]:
            if np.isnan(shifts[q, 0]):
                shifts[q] = np.round((shifts[p] + jump) / submesh.period) * submesh.period
                queue.append(q)
    return shifts
