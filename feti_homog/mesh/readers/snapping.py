"""Nodes near the sides of the cell that the mesh nearly has: moved there, and to where their partners are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from feti_homog.mesh.coarse_mesh import edge_keys, edges
from feti_homog.mesh.readers.mesh_checks import RawMesh
from feti_homog.typing import Float, Int


def snapped(raw: RawMesh, tolerance: float) -> tuple[RawMesh, float]:
    """Return the mesh with its outer edges on the sides of a rectangle, and how far the farthest node has moved.

    Nodes of the outer edges are opposite each other.

    A side lies at the median of the nodes within `tolerance`, relative to the width, of the outermost. Partners, each
    other's nearest within the tolerance along the side, both move to the middle between them. Middle nodes of
    second-order triangles are then midway between the ends of their edges on sides. What is farther stays where it is,
    for the checks to tell.
    """
    plane = raw.points[:, :2].copy()
    if not np.isfinite(plane).all():
        return raw, 0.0
    outer = _outer_nodes(raw)
    reach = tolerance * float(np.ptp(plane[:, 0]))
    sides = {}
    for axis in (0, 1):
        for extreme in (np.min, np.max):
            along = plane[outer, axis]
            near = outer[np.abs(along - extreme(along)) <= reach]
            plane[near, axis] = np.median(plane[near, axis])
            sides[axis, extreme is np.max] = near
    for axis in (0, 1):
        _match(plane, sides[axis, False], sides[axis, True], 1 - axis, reach)
    moved = float(np.linalg.norm(plane - raw.points[:, :2], axis=1).max())
    points = np.column_stack([plane, raw.points[:, 2]])
    return _with_straight_sides(replace(raw, points=points), list(sides.values())), moved


def _outer_nodes(raw: RawMesh) -> Int:
    """Nodes of the edges that one triangle has."""
    pairs = edges(raw.triangles)
    _, first, count = np.unique(edge_keys(pairs, len(raw.points)), return_index=True, return_counts=True)
    return np.asarray(np.unique(pairs[first[count == 1]]), np.int64)


def _match(plane: Float, low: Int, high: Int, along: int, reach: float) -> None:
    """Move partners on two opposite sides to the middle between them, along the sides; corners stay."""
    trees = [cKDTree(plane[side, along, None]) for side in (low, high)]
    (away, to_high), (_, to_low) = trees[1].query(plane[low, along, None]), trees[0].query(plane[high, along, None])
    ends = plane[:, along].min(), plane[:, along].max()
    inner = ~np.isin(plane[low, along], ends) & ~np.isin(plane[high[to_high], along], ends)
    mutual = (to_low[to_high] == np.arange(len(low))) & (away <= reach) & inner
    a, b = low[mutual], high[to_high[mutual]]
    plane[a, along] = plane[b, along] = (plane[a, along] + plane[b, along]) / 2


def _with_straight_sides(raw: RawMesh, sides: list[Int]) -> RawMesh:
    """Return the mesh with middle nodes on its sides midway between their ends."""
    middles = raw.middles
    on_side = np.zeros(len(middles.tags), bool)
    for side in sides:
        on_side |= np.isin(middles.edges, side).all(axis=1)
    midway = raw.points[middles.edges].mean(axis=1)
    return replace(raw, middles=replace(middles, points=np.where(on_side[:, None], midway, middles.points)))
