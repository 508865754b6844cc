"""Pairs of points of the torus that are near each other."""

from __future__ import annotations

from itertools import product

import numpy as np
from scipy.spatial import cKDTree

from feti_homog.errors import MeshError
from feti_homog.typing import Bool, Float, Int

# Fibres beside each other have three pairs each; those on top of each other would fill the memory.
MOST_PAIRS = 100_000_000


def neighbours(centres: Float, size: Float, reach: float) -> tuple[Int, Int, Float]:
    """All pairs i <= j nearer than `reach`, and the vectors (k, 2) from i to that image of j.

    Images of one disc are pairs i = j; each pair of images comes once or, where i = j, from both ends.

    Raises:
        MeshError: there are more than MOST_PAIRS.
    """
    inside = centres % size
    points, owner = [inside], [np.arange(len(centres))]
    for step in product((-1, 0, 1), repeat=2):
        if any(step):
            near = np.flatnonzero(_is_near(inside, np.array(step), size, reach))
            points.append(inside[near] + np.array(step) * size)
            owner.append(near)
    place, who = np.concatenate(points), np.concatenate(owner)
    _refuse_many(place, reach)
    # A tree that is used once is not worth being balanced.
    pairs = cKDTree(place, balanced_tree=False, compact_nodes=False).query_pairs(reach, output_type="ndarray")
    first, second = pairs.T
    keep = np.flatnonzero((first < len(centres)) & (who[first] <= who[second]))
    keep = keep[np.argsort(first[keep] * len(place) + second[keep])]
    first, second = first[keep], second[keep]
    return who[first], who[second], place[second] - place[first]


def _refuse_many(points: Float, reach: float) -> None:
    """Raise MeshError where the pairs of points (n, 2) are too many.

    A point has about 2 pi times as many neighbours as are in its square of the diagonal `reach`.
    """
    if len(points) ** 2 < 2 * MOST_PAIRS or reach <= 0:
        return
    column, row = np.floor(points * (np.sqrt(2) / reach)).astype(np.int64).T
    _, own = np.unique(column * 2**32 + row, return_counts=True)
    count = np.pi * float((own.astype(float) ** 2).sum())
    if count > MOST_PAIRS:
        raise MeshError(
            f"[cell] about {count:.2g} pairs of fibres are nearer to each other than {reach:.2g}; expected at most "
            f"{MOST_PAIRS}: they lie on top of each other, or one is much larger than the others"
        )


def _is_near(inside: Float, step: Int, size: Float, reach: float) -> Bool:
    """(n,) which of the points (n, 2) have an image, by so many periods, that is nearer than `reach` to the cell."""
    near = np.ones(len(inside), bool)
    for axis in np.flatnonzero(step):
        image = inside[:, axis] + step[axis] * size[axis]
        near &= (image > -reach) & (image < size[axis] + reach)
    return near
