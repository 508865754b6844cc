"""Elliptic fibres in a user's mesh: closed interfaces on the torus whose nodes lie on one ellipse."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from feti_homog.cell.circle_detection import MIN_CIRCLE_EDGES, ROUNDNESS_TOLERANCE, closed_loops, on_sides
from feti_homog.cell.coarse_mesh import CoarseMesh, edge_keys
from feti_homog.cell.interface_edges import interface_edges
from feti_homog.cell.middle_nodes import MiddleNodes
from feti_homog.typing import Float

# More edges than a circle: an ellipse has more freedom to go through the corners of a polygon.
MIN_ELLIPSE_EDGES = MIN_CIRCLE_EDGES + 2
# As the longest edges of circles: bent more, elements beside the tips of thin ellipses could turn over.
MOST_BENT = 0.14
# Ratio of semi-axes below which a conic may be a parabola but for rounding.
THINNEST = 1e-4


@dataclass(frozen=True)
class Ellipse:
    """The image centre + frame p of the unit circle |p| = 1; `frame` is (2, 2)."""

    centre: Float
    frame: Float

    def between(self, start: Float, stop: Float) -> Float:
        """(k, 2) the points at the middle parameter between points (k, 2) on the ellipse less than half of it apart."""
        middle = np.linalg.solve(self.frame, ((start + stop) / 2 - self.centre).T)
        return np.asarray(self.centre + (self.frame @ (middle / np.hypot(*middle))).T)


def elliptic_middles(mesh: CoarseMesh) -> MiddleNodes:
    """The middles on the ellipse of the edges of elliptic interfaces that are on no circle.

    A closed interface between two phases is an ellipse if all its nodes are within ROUNDNESS_TOLERANCE of one, and it
    has at least MIN_ELLIPSE_EDGES edges, none on a side of the cell, none that spans more than one radian of its
    parameter or that the ellipse leaves by more than MOST_BENT of its length. Others stay polygons.
    """
    pairs, nodes = interface_edges(mesh), len(mesh.points)
    pairs = pairs[~np.isin(edge_keys(pairs, nodes), edge_keys(mesh.arc_edges, nodes))]
    edges, points = [np.zeros((0, 2), np.int32)], [np.zeros((0, 2))]
    for loop in closed_loops(mesh, pairs, mesh.period, MIN_ELLIPSE_EDGES):
        ellipse = fit(loop.places)
        if ellipse is None:
            continue
        own = pairs[np.isin(mesh.representative[pairs[:, 0]], loop.classes)]
        order = np.argsort(loop.classes)
        start = loop.places[order[np.searchsorted(loop.classes[order], mesh.representative[own[:, 0]])]]
        chord = mesh.points[own[:, 1]] - mesh.points[own[:, 0]]
        bulge = ellipse.between(start, start + chord) - (start + chord / 2)
        too_bent = np.any(np.hypot(*bulge.T) > MOST_BENT * np.hypot(*chord.T))
        if not too_bent and not on_sides(mesh.points[own], mesh.period).any():
            edges.append(own)
            points.append(mesh.points[own[:, 0]] + chord / 2 + bulge)
    found, where = np.concatenate(edges), np.concatenate(points)
    return MiddleNodes(found, np.zeros(len(found), np.int64), np.column_stack([where, np.zeros(len(where))]))


def fit(places: Float) -> Ellipse | None:
    """The ellipse through a closed chain of places (k, 2) in order; None if they are on none or too far apart.

    The conic d.A.d + b.d = 1 that fits best, d from the mean of the places, is |F^-1 (d - c)| = 1.
    """
    mean = places.mean(axis=0)
    scale = np.abs(places - mean).max()
    x, y = ((places - mean) / scale).T
    (xx, xy, yy, bx, by), *_ = np.linalg.lstsq(
        np.column_stack([x * x, x * y, y * y, x, y]), np.ones(len(x)), rcond=None
    )
    A = np.array([[xx, xy / 2], [xy / 2, yy]])
    values, axes = np.linalg.eigh(A)
    if values[0] <= THINNEST**2 * values[1]:
        return None
    centre = -np.linalg.solve(A, [bx, by]) / 2
    level = 1 + centre @ A @ centre
    frame = axes * np.sqrt(level / values)
    on_circle = np.linalg.solve(frame, np.stack([x, y]) - centre[:, None])
    chord = np.hypot(*(np.roll(on_circle, -1, axis=1) - on_circle))
    away = np.abs(np.hypot(*on_circle) - 1)
    if away.max() > ROUNDNESS_TOLERANCE or chord.max() > 2 * np.sin(0.5):
        return None
    return Ellipse(mean + scale * centre, scale * frame)
