"""How fine the coarse mesh is beside outlines of any convex shape."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import numpy as np
from scipy.spatial import cKDTree

from feti_homog.fibres.arrangement import Arrangement
from feti_homog.fibres.shaped_table import POINTS, outer_shapes
from feti_homog.mesh.sizes.from_sources import MAX_GROWTH, wrap
from feti_homog.mesh.sizes.graded_size import MeshSizes
from feti_homog.mesh.sizes.size_field import MIN_EDGES_AROUND, PASSAGE_EDGE
from feti_homog.typing import Float, Int

# Edges of coatings / thickness; cosine of the angle between normals of outlines and sides that face each other.
COATING_EDGE, FACING = 2.0, 0.9
# Sources of sizes that are looked at for each point.
NEAREST = 12
# Smallest size / size of the cell.
LEAST = 1e-5

SizeAt = Callable[[Float], Float]


def shape_sizes(arrangement: Arrangement, sizes: MeshSizes) -> tuple[float, SizeAt]:
    """The least size of elements, and the sizes at positions (n, 2): h = min_k h_k + g |x - x_k| over points x_k of all
    outlines.

    h_k is at most that of interfaces, that of the curvature, and PASSAGE_EDGE times the distance of the next outline or
    of a side of the cell that the outline faces there.
    """
    size, shapes = np.array([arrangement.width, arrangement.height]), outer_shapes(arrangement)
    places, normal, shape = shapes.boundary(POINTS)
    rounds = np.linalg.norm(shapes.frames, axis=1).min(axis=1)
    rounds = np.where(rounds > 0, rounds, np.inf)
    thickness = np.where(arrangement.coated, arrangement.thickness, np.inf)
    length = np.minimum(sizes.interface, PASSAGE_EDGE * _distance_of_others(places, shape, size))
    length = np.minimum(length, np.minimum(2 * np.pi * rounds / MIN_EDGES_AROUND, COATING_EDGE * thickness)[shape])
    for axis in (0, 1):
        away = np.abs(places[:, axis] - np.round(places[:, axis] / size[axis]) * size[axis])
        faces = np.abs(normal[:, axis]) > FACING
        length = np.where(faces, np.minimum(length, PASSAGE_EDGE * away), length)
    length = np.maximum(length, LEAST * size.max())
    tree, nearest = cKDTree(wrap(places, size), boxsize=size), min(NEAREST, len(places))

    def at(positions: Float) -> Float:
        distance, which = tree.query(wrap(positions, size), nearest)
        return np.asarray(np.minimum(sizes.largest, (length[which] + MAX_GROWTH * distance).min(axis=1)))

    return float(length.min()), at


def _distance_of_others(places: Float, shape: Int, size: Float) -> Float:
    """(n,) distances of points (n, 2) from the nearest ones of other shapes (n,) or of an image of their own."""
    distance = np.full(len(places), np.inf)
    steps = np.array(list(product((-1, 0, 1), repeat=2))) * size
    for own in np.unique(shape):
        mine = places[shape == own]
        others = places[shape != own]
        if len(others):
            distance[shape == own] = cKDTree(wrap(others, size), boxsize=size).query(wrap(mine, size))[0]
        images = np.concatenate([mine + step for step in steps if step.any()])
        distance[shape == own] = np.minimum(distance[shape == own], cKDTree(images).query(mine)[0])
    return distance
