"""Fineness of the coarse mesh beside ellipses: the size of edges on the lines of their cell."""

from __future__ import annotations

from itertools import product

import numpy as np
from scipy.spatial import cKDTree

from feti_homog.fibres.arrangement import Arrangement
from feti_homog.fibres.outlines.ellipses import Ellipses, gaps
from feti_homog.fibres.outlines.outlines import directions
from feti_homog.fibres.torus_pairs import neighbours
from feti_homog.mesh.sizes.from_sources import MAX_GROWTH, Source, SourcedSize, wrap
from feti_homog.mesh.sizes.graded_size import (
    MIN_EDGES_AROUND,
    PASSAGE_EDGE,
    WEDGE,
    MeshSizes,
    SizeField,
    at_vertices,
    passage_growth,
)
from feti_homog.typing import Float, Int

# Points of each ellipse at which its curvature, and its distance from corners, are taken.
POINTS = 256
# Edges of coatings / thickness.
LONGEST = 10.0


def size_field(
    arrangement: Arrangement,
    inner: Ellipses,
    sizes: MeshSizes,
    vertices: Float,
    crossings: tuple[Float, Float],
    tips: Float,
) -> SizeField:
    """Field of sizes as `graded_size.size_field`, for the ellipses `inner`.

    `crossings` are where sides of the cell meet ellipses (c, 2), and the length (c,) R phi of the angle phi between
    them where the radius of curvature is R.
    """
    size, largest = arrangement.size, sizes.largest
    shells, disc = arrangement.shells
    ellipses, disc = _in_mesh_order(arrangement, Ellipses(shells.centres, shells.frames), disc)
    angle, which = np.tile(np.linspace(0, 2 * np.pi, POINTS, endpoint=False), len(ellipses)), np.arange(len(ellipses))
    around = np.repeat(which, POINTS)
    points, normal = ellipses[around].points(angle), ellipses[around].normal(angle)
    thin = _coating_size(arrangement, inner, disc[around], normal)
    caps = np.minimum(edge_size(ellipses[around], normal, sizes.interface), thin)
    outer = ellipses[np.sort(np.unique(disc, return_index=True)[1])]
    sources = [
        (points, caps, np.full(len(points), MAX_GROWTH)),
        _between(outer, size, largest),
        _beside_sides(ellipses, size, largest),
        (crossings[0], np.minimum(crossings[1] / WEDGE, largest), np.full(len(crossings[0]), MAX_GROWTH)),
        _at_corner(points, size, largest),
        at_vertices(vertices, size, largest),
    ]
    base = SourcedSize(sources, size, largest)
    if not sizes.are_graded(arrangement):
        return SizeField(base)
    on_curves, beside = cKDTree(wrap(points, size), boxsize=size), np.minimum(sizes.interface, thin)
    tree = cKDTree(wrap(tips.reshape(-1, 2), size), boxsize=size)

    def graded(positions: Float) -> Float:
        places = wrap(positions, size)
        at_tips = sizes.tip + MAX_GROWTH * np.maximum(0.0, tree.query(places)[0] - sizes.tip)
        distance, nearest = on_curves.query(places)
        return np.asarray(np.minimum(beside[nearest] + MAX_GROWTH * distance, at_tips))

    return SizeField(base, graded, min(sizes.tip, float(beside.min())))


def _in_mesh_order(arrangement: Arrangement, ellipses: Ellipses, disc: Int) -> tuple[Ellipses, Int]:
    """Ellipses and their discs (k,) in the order in which these are meshed: the order of rows does not matter."""
    if arrangement.mesh_order is None:
        return ellipses, disc
    order = np.argsort(np.argsort(arrangement.mesh_order)[disc], kind="stable")
    return ellipses[order], disc[order]


def _coating_size(arrangement: Arrangement, inner: Ellipses, disc: Int, normal: Float) -> Float:
    """Largest edge length (k,) on either side of the coatings of discs (k,) where their normals are n (k, 2).

    As of circles, sqrt(t R), with the thickness and the radius of curvature there, but not longer than in the thinnest
    coatings of circles, LONGEST t; infinite without a coating.
    """
    own = inner[disc]
    thickness = own.grown(arrangement.coating[disc]).support(normal) - own.support(normal)
    return np.where(
        arrangement.coated[disc], np.minimum(np.sqrt(thickness * own.bend(normal)), LONGEST * thickness), np.inf
    )


def edge_size(ellipses: Ellipses, normal: Float, largest: float) -> Float:
    """Largest edge length (k,) where the normals are n (k, 2): that of circles of the same curvature."""
    return np.minimum(largest, 2 * np.pi * ellipses.bend(normal) / MIN_EDGES_AROUND)


def _between(ellipses: Ellipses, size: Float, largest: float) -> Source:
    """Facing points of near fibres, with the edges that suit their gap."""
    first, second, vector = neighbours(ellipses.centres, size, 2 * ellipses.longest.max() + largest)
    one = ellipses[first]
    other = Ellipses(one.centres + vector, ellipses.frames[second])
    gap, direction = gaps(one, other)
    normal = directions(direction)
    length = PASSAGE_EDGE * gap
    growth = passage_growth(gap, 1 / one.bend(normal) + 1 / other.bend(-normal))
    near = length < largest
    places = np.concatenate([one.facing(normal)[near], other.facing(-normal)[near]])
    return places, np.tile(length[near], 2), np.tile(growth[near], 2)


def _beside_sides(ellipses: Ellipses, size: Float, largest: float) -> Source:
    """Points where an ellipse comes near a side or hardly crosses it: its extreme point, its foot on the side."""
    sources: list[Source] = []
    for axis, sign in product((0, 1), (-1.0, 1.0)):
        normal = np.zeros((len(ellipses), 2))
        normal[:, axis] = sign
        extreme = ellipses.facing(normal)
        foot = extreme.copy()
        foot[:, axis] = np.round(extreme[:, axis] / size[axis]) * size[axis]
        width = np.abs(extreme - foot)[:, axis]
        length = PASSAGE_EDGE * width
        near = length < largest
        growth = passage_growth(width, 1 / ellipses.bend(normal))
        sources += [(place[near], length[near], growth[near]) for place in (extreme, foot)]
    places, lengths, growths = (np.concatenate(parts) for parts in zip(*sources, strict=True))
    return places, lengths, growths


def _at_corner(points: Float, size: Float, largest: float) -> Source:
    """Return the corner and the nearest of the points (n, 2) of ellipses."""
    offset = (points + size / 2) % size - size / 2
    nearest = offset[np.argmin(np.linalg.norm(offset, axis=1))]
    length = min(PASSAGE_EDGE * float(np.linalg.norm(nearest)), largest)
    return np.stack([nearest, np.zeros(2)]), np.full(2, length), np.full(2, MAX_GROWTH)
