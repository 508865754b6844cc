"""Arcs of circles from vertex to vertex, bridges between circles, and the nodes on them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from scipy.spatial import cKDTree

from feti_homog.cell.bridges import TURN, Bridges, OnCircles
from feti_homog.cell.curves import MATRIX, Curves, Numbering
from feti_homog.cell.edge_samples import EdgeSamples, Sampling
from feti_homog.cell.graded_size import SizeField
from feti_homog.typing import Float, Int

# Relative distance below which two positions are one.
SAME_PLACE = 1e-9
# A mark nearer than this many radians to another vertex of its circle is that vertex.
MERGED = np.radians(0.05)
QUARTER = TURN / 4


def on_circles(circles: Float, which: Int, angles: Float) -> Float:
    """Points (a, 2) on circles which[a] at angles in radians."""
    return on_circle(circles[which], angles)


def on_circle(circles: Float, angles: Float) -> Float:
    """Points (..., 2) on circles (..., 3) at angles in radians."""
    return np.asarray(circles[..., :2] + circles[..., 2:] * np.stack([np.cos(angles), np.sin(angles)], axis=-1))


def vertex_angles(circles: Float, curve: Int, border: Float, marks: Mapping[int, Sequence[float]]) -> OnCircles:
    """Circle (v,) and angle (v,) in [0, 2 pi) of the vertices of circles: crossings of the sides, and the marks."""
    near = cKDTree(border).query_ball_point(circles[:, :2], circles[:, 2] * (1 + SAME_PLACE))
    number = np.repeat(np.arange(len(circles)), [len(candidates) for candidates in near])
    offset = border[np.concatenate([np.zeros(0, np.int64), *filter(len, near)]).astype(int)] - circles[number, :2]
    on_it = np.linalg.norm(offset, axis=1) > circles[number, 2] * (1 - SAME_PLACE)
    number, offset = number[on_it], offset[on_it]
    angle = np.arctan2(offset[:, 1], offset[:, 0]) % TURN
    for own in np.flatnonzero(np.isin(curve, list(marks))).tolist():
        for mark in np.radians(marks[int(curve[own])]) % TURN:
            if all(abs((mark - other + np.pi) % TURN - np.pi) > MERGED for other in angle[number == own]):
                number, angle = np.append(number, own), np.append(angle, mark)
    return number, angle


def arcs_within(
    n_curves: int, curve: Int, angle: Float, at: Callable[[Int, Float], Float], size: Float
) -> tuple[Int, Float, Float]:
    """Curve, start and stop angle (a,) of the arcs within the cell, each at most a quarter turn.

    Closed curve curve[v] has a vertex at angle[v]; one without any gets one at 0. at(curves, angles) are the points
    (a, 2) there.
    """
    without = np.setdiff1d(np.arange(n_curves), curve)
    curve, angle = np.concatenate([curve, without]), np.concatenate([angle, np.zeros(len(without))])
    order = np.lexsort((angle, curve))
    curve, angle = curve[order], angle[order]
    is_first = np.diff(curve, prepend=-1) != 0
    after = np.append(angle[1:], 0.0)
    after[np.append(is_first[1:], True)] = angle[is_first] + TURN
    span = after - angle
    parts = np.maximum(1, np.ceil(span / QUARTER - SAME_PLACE)).astype(int)
    begin = np.repeat(np.arange(len(parts)), parts)
    part = np.arange(len(begin)) - np.repeat(np.cumsum(parts) - parts, parts)
    whose, first, last = curve[begin], *(angle[begin] + (span[begin] * k / parts[begin]) for k in (part, part + 1))
    middle = at(whose, (first + last) / 2)
    within = np.all((middle > 0) & (middle < size), axis=1)
    return whose[within], first[within], last[within]


def arc_curves(
    circles: Float,
    around: Int,
    circle: Int,
    start: Float,
    stop: Float,
    caps: Float,
    field: SizeField,
    numbering: Numbering,
    sampling: Sampling,
) -> Curves:
    """The arcs (a,) from angle `start` to `stop` on their circles as curves, with edges of at most `caps` (a,)."""
    span = stop - start

    def point(arc: Int, share: Float) -> Float:
        return on_circle(circles[circle[arc]], start[arc] + span[arc] * share)

    samples = EdgeSamples.of(field, point, span * circles[circle, 2], lambda arc, share: caps[arc], sampling.arc)
    station, first = samples.stations(np.ones(len(span), np.int64), sampling.most_nodes)
    arc = np.repeat(np.arange(len(span)), np.diff(first))
    return Curves(numbering.along(point(arc, station), first), first, circle, circle, around[circle])


def bridge_curves(
    circles: Float, bridges: Bridges, caps: Float, field: SizeField, numbering: Numbering, sampling: Sampling
) -> Curves:
    """The bridges between circles, on which edges are at most `caps` (k,), as curves.

    Where elements are not graded, edges are no longer than the sizes at both ends, interpolated: so gmsh does it across
    the matrix.
    """
    ends = [on_circles(circles, bridges.ends[:, end], bridges.angle + end * np.pi) for end in (0, 1)]
    begin, way = ends[0], ends[1] - ends[0]
    is_uniform = np.isinf(field.step)
    low, high = (np.minimum(field.at(ends[k]), caps[bridges.ends[:, k]]) for k in (0, 1))

    def point(bridge: Int, share: Float) -> Float:
        return np.asarray(begin[bridge] + share[:, None] * way[bridge])

    def cap(bridge: Int, share: Float) -> Float:
        return (
            np.asarray(low[bridge] * (1 - share) + high[bridge] * share) if is_uniform else np.full(len(share), np.inf)
        )

    samples = EdgeSamples.of(field, point, np.linalg.norm(way, axis=1), cap, sampling.bridge)
    share, first = samples.stations(np.ones(len(way), np.int64), sampling.most_nodes)
    bridge = np.repeat(np.arange(len(way)), np.diff(first))
    straight = np.full(len(way), MATRIX)
    return Curves(numbering.along(point(bridge, share), first), first, straight, straight, straight)
