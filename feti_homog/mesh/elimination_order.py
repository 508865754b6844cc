"""Elimination order for a factorization: nested dissection by straight cuts.

George (SIAM J. Numer. Anal. 10 (1973) 345): nodes on a cut follow the nodes on both sides, so that fill stays within.
Coarse triangles are halved again and again along x or y, each time about the middle where the cut crosses fewest sides;
their refined nodes follow.  The fill is less than by minimum degree.
"""

from __future__ import annotations

import numpy as np

from feti_homog.mesh.coarse_mesh import edge_keys, edges
from feti_homog.mesh.periodic_topology import edge_pairs
from feti_homog.mesh.refinement import FineMesh
from feti_homog.typing import Float, Int, Int32

# Share of the triangles of a part by which a cut may be off the middle.
OFF_THE_MIDDLE = 0.1
# Intervals a side from which on the nodes inside a coarse triangle are ordered likewise: below, they are few.
MANY_INTERVALS = 8


def elimination_order(mesh: FineMesh) -> Int:
    """(c,) node classes in elimination order."""
    lattice = mesh.lattice
    inside = np.arange(len(lattice.nodes))
    if lattice.intervals >= MANY_INTERVALS:
        centres = lattice.nodes[lattice.triangles[:, :3]].mean(axis=1)[:, 1:]
        inside[_dissected(centres, lattice.triangles, np.arange(lattice.triangles.shape[1]))] = np.arange(len(inside))
    return _dissected(mesh.points[mesh.nodes[:, :3]].mean(axis=1), mesh.node_class[mesh.nodes], inside)


def _dissected(centres: Float, nodes: Int | Int32, inside: Int) -> Int:
    """(n,) nodes in order, for triangles with `centres` (t, 2) and `nodes` (t, q), corners first.

    Nodes in a single triangle are ordered by their places `inside` (q,).
    """
    size, leaf = (
        int(nodes.max()) + 1,
        _halved(centres, edge_pairs(edge_keys(edges(np.asarray(nodes[:, :3], np.int32)), int(nodes.max()) + 1))),
    )
    by_leaf = np.argsort(leaf)
    of_leaf, node = np.repeat(leaf[by_leaf], nodes.shape[1]), nodes[by_leaf].ravel()
    first, last, place = np.empty((3, size), np.int64)
    last[node], first[node[::-1]], place[nodes] = of_leaf, of_leaf[::-1], inside
    height = np.frexp((first ^ last).astype(float))[1]  # above the leaves, of the smallest part with all its triangles
    end = (last >> height) + 1 << height
    return np.asarray(np.lexsort((place, height, end)))


def _halved(centres: Float, neighbours: tuple[Int, Int]) -> Int:
    """(t,) leaf number for each triangle in a binary tree whose parts are halved; some leaves are empty."""
    t, first = len(centres), np.array([0, len(centres)])
    order = np.arange(t)
    by_coordinate = [np.argsort(x, kind="stable") for x in centres.T]
    part = np.zeros(t, np.int64)
    while (size := np.diff(first)).max() > 1:
        of_place = np.repeat(np.arange(len(size)), size)
        part[order] = of_place
        cuts = [_cut(along[np.argsort(part[along], kind="stable")], part, first, neighbours) for along in by_coordinate]
        (order_x, at_x, crossed_x), (order_y, at_y, crossed_y) = cuts
        by_y = crossed_y < crossed_x
        order = np.where(by_y[of_place], order_y, order_x)
        halves = np.empty(2 * len(first) - 1, np.int64)
        halves[::2], halves[1::2] = first, np.where(by_y, at_y, at_x)
        first = halves
    leaf = np.empty(t, np.int64)
    leaf[order] = np.repeat(np.arange(len(first) - 1), np.diff(first))
    return leaf


def _cut(order: Int, part: Int, first: Int, neighbours: tuple[Int, Int]) -> tuple[Int, Int, Float]:
    """Return the triangle order, the place where it cuts each part, and how many sides are crossed.

    `order` (t,) has one `part` after the other, which begin at `first`.
    """
    t, size = len(order), np.diff(first)
    place = np.empty(t, np.int64)
    place[order] = np.arange(t)
    one, other = (place[side] for side in neighbours)
    within = part[neighbours[0]] == part[neighbours[1]]
    begin, end = np.minimum(one, other)[within] + 1, np.maximum(one, other)[within] + 1
    crossed = np.cumsum(np.bincount(begin, minlength=t + 1) - np.bincount(end, minlength=t + 1))[:t]
    offset = np.abs(np.arange(t) - np.repeat((first[:-1] + first[1:]) / 2, size))
    middle = np.flatnonzero(offset <= np.repeat(np.maximum(OFF_THE_MIDDLE * size, 0.5), size))
    cost = crossed[middle] + offset[middle] / t
    sought = np.lexsort((cost, part[order[middle]]))
    best = sought[np.minimum(np.searchsorted(part[order[middle]], np.arange(len(size))), len(sought) - 1)]
    alone = size < 2
    return order, np.where(alone, first[1:], middle[best]), np.where(alone, 0.0, cost[best])
