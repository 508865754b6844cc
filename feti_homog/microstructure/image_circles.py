"""Find round fibres in grey values by Hough's transform of edges, and fit circles by least squares."""

import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates, maximum_filter
from scipy.spatial import cKDTree

from feti_homog.microstructure.shapes import directions
from feti_homog.typing import Bool, Float, Int

SMALLEST = 3.0  # radius in pixels
# For each fit: largest distance of an edge from its circle, in radii, and least `_excess` of edges on a circle.
FITS = (0.2, 0.5), (0.1, 1.0), (0.05, 2.2)
RIM = directions(np.linspace(0.0, 2 * np.pi, 65))


def round_fibres(image: Float) -> Float:
    """Find circles (k, 3) around round fibres in an image of several grey values: centres and radii in pixels.

    Edges are ridges in the slope of the filtered grey values, above the root mean square slope. Fibres are bright or
    dark, whichever puts more edges on circles. The first row of the image (rows, columns) is the lowest.
    """
    slope = np.stack(np.gradient(gaussian_filter(image, 1.5)))
    steepness = np.hypot(*slope)
    places = np.stack(np.nonzero(steepness > np.sqrt((steepness**2).mean())))
    middle = steepness[*places]
    normal = slope[:, *places] / middle
    before, after = (map_coordinates(steepness, places + k * normal, order=1, mode="nearest") for k in (-1, 1))
    ridge = (middle > before) & (middle >= after)
    # The vertex of the parabola through three values.
    vertex = (after - before)[ridge] / (2 * (2 * middle - before - after)[ridge])
    normal = normal[:, ridge]
    edges = (places[:, ridge] + vertex * normal).T[:, ::-1] + 0.5
    sides = [_fitted(edges, sign * normal.T[:, ::-1], image.T.shape) for sign in (1, -1)]
    return max(sides, key=lambda side: side[0])[1]


def _fitted(edges: Float, inward: Float, size: tuple[int, ...]) -> tuple[float, Float]:
    """Fit circles to edges (n, 2) with unit normals `inward` (n, 2) in an image of `size` (columns, rows).

    Returns the fraction of the edges that lie on circles, and the circles (k, 3).
    """
    radius, peaks = SMALLEST, [np.zeros((0, 4))]
    while radius < min(size) / 2:
        # Bins of votes grow with the radius, as the errors of normals do; around a centre there are few other votes.
        width = max(1.0, radius / 6)
        shape = (np.array(size) / width).astype(int) + 5
        column, row = np.floor((edges + radius * inward) / width).astype(int).T + 2
        is_near = (column >= 0) & (row >= 0) & (column < shape[0]) & (row < shape[1])
        count = np.bincount((row * shape[0] + column)[is_near], minlength=shape.prod()).reshape(shape[::-1])
        votes, around = (2 * np.pi * gaussian_filter(count.astype(float), s, mode="constant") for s in (1.0, 4.0))
        row, column = np.nonzero((votes == maximum_filter(votes, 3)) & (votes > np.maximum(radius, 3 * around)))
        centre = (np.column_stack([column, row]) - 1.5) * width
        peaks.append(np.column_stack([centre, np.full(len(row), radius), votes[row, column]]))
        radius *= 1.1
    circles, counts = np.split(np.concatenate(peaks), [3], axis=1)
    excess = _excess(circles, counts[:, 0], size, 0.15)
    circles, excess = circles[excess > 0.3], excess[excess > 0.3]
    for reach, least in FITS:
        circles = circles[_apart(circles, excess)]
        circles = circles[circles[:, 2] >= SMALLEST]
        if not len(circles):
            return 0.0, circles
        distance, nearest = cKDTree(circles[:, :2]).query(edges, range(1, min(6, len(circles)) + 1))
        error = np.abs(distance / circles[nearest, 2] - 1)
        place, best = np.arange(len(edges)), error.argmin(axis=1)
        owner, error = nearest[place, best], error[place, best]
        is_on = error < np.maximum(reach, 1.0 / circles[owner, 2])
        part, owner = float(is_on.mean()), owner[is_on]
        # x^2 + y^2 = 2 a x + 2 b y + c about the previous centre, by normal equations.
        x, y = (edges[is_on] - circles[owner, :2]).T
        rows = np.stack([2 * x, 2 * y, np.ones_like(x)])
        sums = [np.bincount(owner, row, len(circles)) for row in (rows[:, None] * rows).reshape(9, -1)]
        right = [np.bincount(owner, row * (x**2 + y**2), len(circles)) for row in rows]
        excess = _excess(circles, np.bincount(owner, minlength=len(circles)), size, 0.3)
        is_round = excess > least
        N, b = np.stack(sums, axis=1).reshape(-1, 3, 3)[is_round], np.stack(right, axis=1)[is_round, :, None]
        moved = (np.linalg.pinv(N, hermitian=True) @ b)[..., 0]  # points on a line leave N singular
        radius = np.sqrt(np.maximum(moved[:, 2] + moved[:, 0] ** 2 + moved[:, 1] ** 2, 0.0))
        circles, excess = np.column_stack([circles[is_round, :2] + moved[:, :2], radius]), excess[is_round]
    return part, circles[_apart(circles, excess)]


def _excess(circles: Float, counts: Float | Int, size: tuple[int, ...], by_chance: float) -> Float:
    """Measure how many more edges than by chance lie on each circle (k,).

    Returns (f - `by_chance`) sqrt(L) for f edges per pixel, at most 1, on L visible rim pixels; 0 if 80 % are hidden.
    """
    rim = circles[:, :2] + circles[:, 2:] * RIM[:, None]
    visible = ((rim > 0.0) & (rim < size)).all(axis=2).mean(axis=0)
    length = np.maximum(visible * 2 * np.pi * circles[:, 2], 1.0)
    return np.where(visible > 0.2, (np.minimum(counts / length, 1.0) - by_chance) * np.sqrt(length), 0.0)


def _apart(circles: Float, excess: Float) -> Bool:
    """Mark circles (k,), highest `excess` first, unless a marked one overlaps by over 0.4 of the smaller radius."""
    tree, is_apart = cKDTree(circles[:, :2]), np.zeros(len(circles), bool)
    is_covered = np.zeros(len(circles), bool)
    for k in np.argsort(-excess, kind="stable"):
        if not is_covered[k]:
            rivals = np.array(tree.query_ball_point(circles[k, :2], 2 * circles[k, 2]))
            x, y = (circles[rivals, :2] - circles[k, :2]).T
            both = circles[rivals, 2] + circles[k, 2]
            smaller = np.minimum(circles[rivals, 2], circles[k, 2])
            rivals = rivals[np.hypot(x, y) < both - 0.4 * smaller]
            is_apart[k] = not is_apart[rivals].any()
            is_covered[rivals] |= is_apart[k]
    return is_apart
