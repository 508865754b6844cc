"""Quadrilaterals, each cut in two triangles."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components, dijkstra

from feti_homog.typing import Bool, Float, Int

# The triangles on either side of the diagonal 02, and on either side of the diagonal 13.
HALVES = np.array([[[0, 1, 2], [0, 2, 3]], [[0, 1, 3], [1, 2, 3]]])
# Ratio of the smaller triangles by which the diagonal that leaves the larger one is preferred to alternate ones.
MUCH_LARGER = 2.0


def in_triangles(corners: Int, points: Float) -> Int:
    """Return the two triangles (m, 2, 3) of quadrilaterals (m, 4) with corners among points (n, 2 or 3).

    Diagonals join nodes that an even number of sides parts from the first node, so that they alternate in a grid:
    parallel ones couple stretch and shear.  The cut depends on places, not on numbers.  Where such a diagonal leaves a
    much smaller triangle than the other one, or sides do not tell, the other one or the better one is taken.
    """
    x, y = points[corners].T[:2]  # (4, m)

    def area(i: int, j: int, k: int) -> Float:
        return np.asarray((x[j] - x[i]) * (y[k] - y[i]) - (x[k] - x[i]) * (y[j] - y[i]))

    sense = np.sign(area(0, 1, 2) + area(0, 2, 3))
    first, second = (np.minimum(*(sense * area(*half) for half in pair)) for pair in HALVES.tolist())
    even = _is_even(corners, points)
    wanted = np.where((even != np.roll(even, 1, axis=1)).all(axis=1), np.where(even[:, 0], 1, -1), 0)
    limit = np.where(wanted == 0, 1.0, MUCH_LARGER**wanted)
    chosen = HALVES[(second > limit * first).astype(int)]
    return np.take_along_axis(corners[:, None], chosen, axis=2)


def _is_even(corners: Int, points: Float) -> Bool:
    """(m, 4) whether an even number of sides parts a corner from the first node of its connected quadrilaterals."""
    used, inner = np.unique(corners, return_inverse=True)
    n, inner = len(used), inner.reshape(-1, 4)
    ends = inner.ravel(), np.roll(inner, -1, axis=1).ravel()
    sides = coo_matrix((np.ones(len(ends[0])), ends), shape=(n, n)).tocsr()
    order = np.lexsort(points[used, :2].T)
    part = connected_components(sides, directed=False)[1]
    first = order[np.unique(part[order], return_index=True)[1]]
    away = dijkstra(sides, directed=False, indices=first, unweighted=True, min_only=True)
    return np.asarray(away % 2 == 0)[inner]
