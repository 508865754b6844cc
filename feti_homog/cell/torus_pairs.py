"""Pairs of points of the torus that are near each other."""

from __future__ import annotations

from itertools import product

import numpy as np
from scipy.spatial import cKDTree

from feti_homog.typing import Float, Int


def neighbours(centres: Float, size: Float, reach: float) -> tuple[Int, Int, Float]:
    """All pairs i <= j nearer than `reach`, and the vectors (k, 2) from i to that image of j.

    Images of one disc are pairs i = j; each pair of images comes once or, where i = j, from both ends.
    """
    inside = centres % size
    points, owner = [inside], [np.arange(len(centres))]
    for step in product((-1, 0, 1), repeat=2):
        image = inside + np.array(step) * size
        near = np.all((image > -reach) & (image < size + reach), axis=1)
        if any(step):
            points.append(image[near])
            owner.append(np.flatnonzero(near))
    place, who = np.concatenate(points), np.concatenate(owner)
    pairs = cKDTree(place).query_pairs(reach, output_type="ndarray")
    pairs = pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]
    first, second = pairs[:, 0], pairs[:, 1]
    keep = (first < len(centres)) & (who[first] <= who[second])
    first, second = first[keep], second[keep]
    return who[first], who[second], place[second] - place[first]
