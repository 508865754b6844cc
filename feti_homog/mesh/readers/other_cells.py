"""Meshes of cells that are no rectangle, or have a hole at a corner: the rectangle or the shift that helps."""

from __future__ import annotations

from itertools import product

import numpy as np
from scipy.spatial import ConvexHull

from feti_homog.mesh.coarse_mesh import areas
from feti_homog.mesh.readers.raw_mesh import at
from feti_homog.typing import Float, Int32

# Sine of the angle at a node of the hull, and cosine between vectors of a lattice, that are zero but for rounding.
STRAIGHT, RIGHT = 1e-5, 1e-6
# Slope of sides that may be meant to be upright; share of the hull that a cell with voids fills at least.
UPRIGHT, FILLED = 1e-2, 0.4
LARGEST_MULTIPLE = 6  # of the vectors of a lattice in those of its rectangle
SHIFTS = (0.5, 0.25, 0.75, 0.375, 0.625, 0.125, 0.875)


def lattice(plane: Float, triangles: Int32) -> list[str]:
    """Return the fault of triangles that fill a parallelogram or a hexagon, with the rectangle of the same lattice."""
    hull = ConvexHull(plane)
    corners = _corners(plane[hull.vertices])
    if len(corners) not in (4, 6) or np.abs(areas(plane, triangles)).sum() < FILLED * hull.volume:
        return []
    sides = np.roll(corners, -1, axis=0) - corners
    half = len(sides) // 2
    size = np.abs(sides).max()
    if np.abs(sides[:half] + sides[half:]).max() > STRAIGHT * size or _is_upright(sides[:half]):
        return []
    # Opposite sides of the hexagon are these vectors apart.
    first, second = (sides[0], sides[1]) if half == 2 else (sides[0] + sides[1], sides[1] + sides[2])
    name = "parallelogram" if half == 2 else "hexagon"
    return [f"the cell is a {name}, expected a rectangle: {_rectangle(first, second)}"]


def _corners(hull: Float) -> Float:
    """Corners (k, 2) of a convex hull, counter-clockwise, without the nodes on its straight sides."""
    before, after = hull - np.roll(hull, 1, axis=0), np.roll(hull, -1, axis=0) - hull
    turn = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    return np.asarray(hull[turn > STRAIGHT * np.linalg.norm(before, axis=1) * np.linalg.norm(after, axis=1)])


def _is_upright(sides: Float) -> bool:
    """Return whether two sides (2, 2) are along the axes."""
    return len(sides) == 2 and bool((np.abs(sides).min(axis=1) <= UPRIGHT * np.abs(sides).max(axis=1)).all())


def _rectangle(first: Float, second: Float) -> str:
    """Return the smallest rectangle of the lattice of two vectors in words, and how to make it."""
    numbers = range(-LARGEST_MULTIPLE, LARGEST_MULTIPLE + 1)
    vectors = np.array([m * first + n * second for m, n in product(numbers, numbers) if (m, n) != (0, 0)])
    right = vectors[(vectors[:, 0] > 0) | ((vectors[:, 0] == 0) & (vectors[:, 1] > 0))]
    length = np.linalg.norm(right, axis=1)
    cosine = np.abs(right @ vectors.T) / np.outer(length, np.linalg.norm(vectors, axis=1))
    area = np.abs(np.cross(right[:, None], vectors))
    area[cosine > RIGHT] = np.inf
    if not np.isfinite(area).any():
        return 'shear its lattice to a ratio of integers, see "Lattices that are no rectangle" in meshes/README.md'
    slope = np.minimum(*np.abs(right.T)) / length
    least = area.min()
    # Of equal ones the rectangle along the axes.
    pairs = np.argwhere(area < least * (1 + RIGHT))
    i, j = min(pairs.tolist(), key=lambda pair: (round(float(slope[pair[0]]), 6), float(length[pair[0]])))
    u, v = sorted((right[i], vectors[j]), key=lambda w: abs(w[1]))
    count = round(float(least / abs(np.cross(first, second))))
    sizes = " x ".join(f"{np.linalg.norm(w):.6g}" for w in (u, v))
    turned = "" if abs(u[1]) <= RIGHT * abs(u[0]) else f", along {at(u)}: turn the lattice first"
    copies = f"copies of the cell moved by {at(first)} and {at(second)}"
    ways = f'cut it from {copies}, or list the fibres, geometry = "table"'
    return f"its lattice has the rectangle {sizes} of {count} cells{turned}; {ways}"


def shift(plane: Float, triangles: Int32, size: Float) -> str:
    """Return the shift of a cell that puts its corners into material, in words; empty if none is found."""
    a, b, c = np.moveaxis(plane[triangles], 1, 0)
    for fractions in product(SHIFTS, SHIFTS):
        place = np.array(fractions) * size
        sides = [np.cross(q - p, place - p) for p, q in ((a, b), (b, c), (c, a))]
        if (np.min(sides, axis=0) > 0).any():
            shifted = f"mesh the cell with all places moved by {at(-place)} modulo {at(size)}"
            return f"if a hole is there, {shifted}: then its corners are in material"
    return ""
