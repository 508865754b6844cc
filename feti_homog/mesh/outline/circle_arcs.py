"""Vertices of closed curves, among them the marks, places such as tips of debonded arcs, and the arcs between them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from scipy.spatial import cKDTree

from feti_homog.fibres.arrangement import Arrangement
from feti_homog.mesh.outline.bridges import TURN, OnCircles
from feti_homog.typing import Float, Int

# Relative distance below which two positions are one.
SAME_PLACE = 1e-9
# A mark nearer than this many radians to another vertex of its circle is that vertex.
MERGED = np.radians(0.05)
QUARTER = TURN / 4


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


def marked(arrangement: Arrangement, marks: Mapping[int, Sequence[float]]) -> tuple[Int, Float]:
    """Curve and angle in radians (t,) of the marks on curves that are there.

    k is the outer curve of fibre k, ~k that within its coating.
    """
    there = {*range(len(arrangement.radii)), *(~np.flatnonzero(arrangement.coated)).tolist()}
    known = {curve: own for curve, own in marks.items() if curve in there}
    curve = np.repeat(list(known), [len(own) for own in known.values()]).astype(int)
    return curve, np.radians([mark for own in known.values() for mark in own])
