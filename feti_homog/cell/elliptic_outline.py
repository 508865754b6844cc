"""The lines of a cell with ellipses: its sides and the arcs in it, cut where they meet, with nodes on them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product

import numpy as np
from scipy.spatial import cKDTree

from feti_homog.cell.arrangement import Arrangement
from feti_homog.cell.edge_samples import EdgeSamples
from feti_homog.cell.ellipses import Ellipses, directions
from feti_homog.cell.elliptic_size import size_field
from feti_homog.cell.graded_size import MeshSizes, SizeField
from feti_homog.cell.outline import (
    ARC_SAMPLES,
    MATRIX,
    MERGED,
    SAME_PLACE,
    SIDE_SAMPLES,
    TURN,
    Curve,
    Numbering,
    Outline,
    arcs_within,
    on_side,
)
from feti_homog.typing import Float, Int

# Steps of a quarter of an ellipse between which its length is taken to be linear.
LENGTH_STEPS = 256


def outline(arrangement: Arrangement, sizes: MeshSizes, marks: Mapping[int, Sequence[float]]) -> Outline:
    """As `outline.outline`."""
    size = np.array([arrangement.width, arrangement.height])
    ellipses, fibre = _images(arrangement, size)
    places = [_crossings(ellipses, axis, size) for axis in (0, 1)]
    sides = ((axis, level) for axis in (0, 1) for level in (0.0, size[1 - axis]))
    border = np.concatenate([on_side(places[axis], axis, level) for axis, level in sides])
    angles, sharp = _vertex_angles(ellipses, fibre, border, size, marks)
    which, start, stop = arcs_within(angles, lambda of, angle: ellipses[of].at(angle), size)
    ends = ellipses[which].at(start)
    away = cKDTree(border).query(ends)[0] > SAME_PLACE * size.max()
    numbering = Numbering(np.concatenate([np.unique(border, axis=0), ends[away]]))
    tips = _tips(arrangement, marks, numbering.vertices, size)
    field = size_field(arrangement, sizes, numbering.vertices, sharp, tips)
    curves = []
    for axis in (0, 1):
        curves += _side_curves(axis, places[axis], ellipses, size, field, numbering)
    curves += _arc_curves(ellipses, which, start, stop, sizes.interface, field, numbering)
    around = np.full(len(ellipses), MATRIX)
    return Outline(numbering.points(), tuple(curves), ellipses, fibre, around)


def _images(arrangement: Arrangement, size: Float) -> tuple[Ellipses, Int]:
    """Periodic images that may reach into the cell, fibre by fibre, and their fibres (k,)."""
    steps = np.array(list(product((-1, 0, 1), repeat=2)))
    order = arrangement.mesh_order
    fibre = np.repeat(np.arange(len(arrangement.radii)) if order is None else order, len(steps))
    own = arrangement.ellipses[fibre]
    moved = Ellipses(own.centres + np.tile(steps, (len(arrangement.radii), 1)) * size, own.frames)
    near = np.all((moved.centres + moved.reach > 0) & (moved.centres - moved.reach < size), axis=1)
    return moved[near], fibre[near]


def _crossings(ellipses: Ellipses, axis: int, size: Float) -> Float:
    """Sorted coordinates along `axis` of the vertices on the side at 0: corners and crossings of ellipses.

    d = x - c with the known component v obeys d . (F F^T)^-1 d = 1.
    """
    inverse, other = np.linalg.inv(ellipses.squares), 1 - axis
    v, centre = -ellipses.centres[:, other], ellipses.centres[:, axis]
    p, q = inverse[:, axis, axis], inverse[:, axis, other] * v
    root = q**2 - p * (inverse[:, other, other] * v**2 - 1)
    half = np.sqrt(np.maximum(root, 0.0)) / p
    crossing = np.concatenate([centre - q / p - half, centre - q / p + half])[np.tile(half > 0, 2)]
    return np.concatenate([[0.0], np.sort(crossing[(crossing > 0) & (crossing < size[axis])]), [size[axis]]])


def _vertex_angles(
    ellipses: Ellipses, fibre: Int, border: Float, size: Float, marks: Mapping[int, Sequence[float]]
) -> tuple[list[Float], tuple[Float, Float]]:
    """Sorted parameters in [0, 2 pi) of the vertices of each ellipse: crossings of the sides, and the marks.

    Also the crossings (c, 2), and R phi (c,) of the angle between side and ellipse there, whose radius is R.
    """
    angles, where, lengths = [], [np.zeros((0, 2))], [np.zeros(0)]
    near = cKDTree(border).query_ball_point(ellipses.centres, ellipses.longest * (1 + SAME_PLACE))
    for number, (owner, candidates) in enumerate(zip(fibre.tolist(), near, strict=True)):
        places = border[candidates]
        one = ellipses[np.full(len(places), number)]
        on_it = np.abs(np.linalg.norm(one.unit(places - one.centres), axis=1) - 1) < SAME_PLACE
        places, one = places[on_it], one[on_it]
        own = one.parameter(places - one.centres) % TURN
        normal = one.normal(own)
        along = np.where(_on_upright(places, size), normal[:, 0], normal[:, 1])
        where.append(places)
        lengths.append(one.bend(normal) * np.arccos(np.minimum(np.abs(along), 1.0)))
        marked, offsets = np.radians(marks.get(owner, ())), places - ellipses.centres[number]
        away = np.abs((marked[:, None] - np.arctan2(offsets[:, 1], offsets[:, 0]) + np.pi) % TURN - np.pi)
        marked = marked[(away > MERGED).all(axis=1)]
        mine = ellipses[np.full(len(marked), number)]
        own = np.append(own, mine.parameter(directions(marked)) % TURN)
        angles.append(np.sort(own) if len(own) else np.zeros(1))
    return angles, (np.concatenate(where), np.concatenate(lengths))


def _on_upright(places: Float, size: Float) -> Float:
    """(n,) whether positions (n, 2) on the border are on the left or right side."""
    return np.asarray(np.abs(places[:, 0] - np.clip(np.round(places[:, 0] / size[0]), 0, 1) * size[0]) == 0)


def _tips(arrangement: Arrangement, marks: Mapping[int, Sequence[float]], vertices: Float, size: Float) -> Float:
    """The vertices (t, 2) that the marks have become; those of fibres that are not there are none."""
    known = {fibre: own for fibre, own in marks.items() if fibre < len(arrangement.radii)}
    own = arrangement.ellipses[np.repeat(list(known), [len(angles) for angles in known.values()]).astype(int)]
    angle = np.radians([mark for angles in known.values() for mark in angles])
    places = own.at(own.parameter(directions(angle)))
    return np.asarray(vertices[cKDTree(vertices % size, boxsize=size).query(places % size)[1]])


def _side_curves(
    axis: int, places: Float, ellipses: Ellipses, size: Float, field: SizeField, numbering: Numbering
) -> list[Curve]:
    """The pieces of the two sides along `axis`, with the same nodes on both."""
    begin, span = places[:-1], np.diff(places)

    def point(piece: Int, share: Float) -> Float:
        return on_side(begin[piece] + span[piece] * share, axis, 0.0)

    samples = EdgeSamples.of(field, point, span, np.full(len(span), np.inf), SIDE_SAMPLES)
    curves = []
    for level, low in ((0.0, True), (size[1 - axis], False)):
        holds = ellipses.level(on_side(begin + span / 2, axis, level)) < 1
        inside = np.where(holds.any(axis=1), holds.argmax(axis=1), MATRIX)
        for number, stations in enumerate(samples.stations(np.where(inside == MATRIX, 1, 2))):
            along = begin[number] + span[number] * stations
            along[[0, -1]] = places[number : number + 2]
            nodes = numbering.along(on_side(along, axis, level))
            curves.append(Curve(nodes if low == (axis == 0) else nodes[::-1], MATRIX, int(inside[number])))
    return curves


def _arc_curves(
    ellipses: Ellipses, which: Int, start: Float, stop: Float, largest: float, field: SizeField, numbering: Numbering
) -> list[Curve]:
    """The arcs (a,) between parameters as curves, with edges of at most `largest` or what the curvature asks for."""
    own = ellipses[which]
    share = np.linspace(0, 1, LENGTH_STEPS + 1)
    angle = start[:, None] + (stop - start)[:, None] * share
    places = np.stack([own.at(angle[:, k]) for k in range(len(share))], axis=1)
    length = np.cumsum(np.linalg.norm(np.diff(places, axis=1), axis=2), axis=1)
    way = np.column_stack([np.zeros(len(length)), length / length[:, -1:]])

    def parameter(arc: Int, share: Float) -> Float:
        """(n,) at the share of an arc's length."""
        after = np.clip((way[arc] <= share[:, None]).sum(axis=1), 1, LENGTH_STEPS)
        low, high = way[arc, after - 1], way[arc, after]
        part = (share - low) / (high - low)
        return np.asarray(angle[arc, after - 1] * (1 - part) + angle[arc, after] * part)

    def point(arc: Int, share: Float) -> Float:
        return own[arc].at(parameter(arc, share))

    samples = EdgeSamples.of(field, point, length[:, -1], np.full(len(own), largest), ARC_SAMPLES)
    curves = []
    for number, stations in enumerate(samples.stations(np.ones(len(own), dtype=np.intp))):
        arc = np.full(len(stations), number)
        nodes = numbering.along(point(arc, stations))
        curves.append(Curve(nodes, int(which[number]), int(which[number])))
    return curves
