"""Elliptic fibres in a user's mesh: closed interfaces on the torus whose nodes lie on one ellipse."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from feti_homog.fibres.outlines.ellipses import Ellipses
from feti_homog.mesh.coarse_mesh import CoarseMesh, edge_keys, flip_double_arcs, interface_edges
from feti_homog.mesh.readers.circle_detection import (
    MIN_CIRCLE_EDGES,
    ROUNDNESS_TOLERANCE,
    closed_loops,
    loop_images,
    on_sides,
)
from feti_homog.mesh.readers.raw_mesh import MiddleNodes
from feti_homog.typing import Float, Int32

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

    def moved(self, step: Float) -> Ellipse:
        """By a vector (2,)."""
        return replace(self, centre=self.centre + step)

    def between(self, start: Float, stop: Float) -> Float:
        """(k, 2) the points at the middle parameter between points (k, 2) on the ellipse less than half of it apart."""
        middle = np.linalg.solve(self.frame, ((start + stop) / 2 - self.centre).T)
        return np.asarray(self.centre + (self.frame @ (middle / np.hypot(*middle))).T)


def with_ellipses(mesh: CoarseMesh, middles: MiddleNodes) -> CoarseMesh:
    """Return the mesh whose elliptic interfaces that are no circles follow their ellipses.

    A closed interface between two phases is an ellipse if all its nodes are within ROUNDNESS_TOLERANCE of one, and it
    has at least MIN_ELLIPSE_EDGES edges, none on a side of the cell, none that spans more than one radian of its
    parameter or that the ellipse leaves by more than MOST_BENT of its length. Where its edges have middle nodes these
    must lie on it too. Others stay as they are. Edges are flipped where a triangle has two on one ellipse.
    """
    pairs, nodes = interface_edges(mesh), len(mesh.points)
    pairs = pairs[~np.isin(edge_keys(pairs, nodes), edge_keys(mesh.arc_edges, nodes))]
    bends, own_ellipses, arcs = middles.between(pairs), [], []
    for loop in closed_loops(mesh, pairs, mesh.period, MIN_ELLIPSE_EDGES):
        ellipse = fit(loop.places)
        own = np.isin(mesh.representative[pairs[:, 0]], loop.classes)
        if ellipse is None or on_sides(mesh.points[pairs[own]], mesh.period).any():
            continue
        images = loop_images(mesh, loop, pairs[own])
        places = [(ellipse.moved(-step), pairs[own][mine], bends[own][mine]) for step, mine in images]
        if all(_follow(image, mesh.points[edges], bend) for image, edges, bend in places):
            own_ellipses += [image for image, _, _ in places]
            arcs += [edges for _, edges, _ in places]
    return _with_arcs(mesh, own_ellipses, arcs)


def _follow(ellipse: Ellipse, ends: Float, bends: Float) -> bool:
    """Return whether edges may follow the ellipse.

    Their ends are (k, 2, 2) and their middle nodes (k, 2), NaN if there are none.
    """
    chord = ends[:, 1] - ends[:, 0]
    bulge = ellipse.between(ends[:, 0], ends[:, 1]) - ends.mean(axis=1)
    off = np.abs(np.linalg.norm(np.linalg.solve(ellipse.frame, (bends - ellipse.centre).T), axis=0) - 1)
    return bool(np.all(np.hypot(*bulge.T) <= MOST_BENT * np.hypot(*chord.T)) and not np.any(off > ROUNDNESS_TOLERANCE))


def _with_arcs(mesh: CoarseMesh, found: list[Ellipse], arcs: list[Int32]) -> CoarseMesh:
    """Return the mesh with these ellipses and their edges (a, 2) as well."""
    if not found:
        return mesh
    edges, number = np.concatenate(arcs), np.repeat(np.arange(len(arcs), dtype=np.int32), [len(own) for own in arcs])
    ellipses = Ellipses(np.array([own.centre for own in found]), np.array([own.frame for own in found]))
    return replace(
        mesh,
        triangles=flip_double_arcs(mesh.triangles, mesh.phase, edges, number, len(mesh.points)),
        ellipses=mesh.ellipses.joined(ellipses),
        arc_edges=np.concatenate([mesh.arc_edges, edges]),
        arc_circle=np.concatenate([mesh.arc_circle, len(mesh.ellipses) + number]).astype(np.int32),
    )


def fit(places: Float) -> Ellipse | None:
    """Return the ellipse through a closed chain of places (k, 2) in order.

    None if they are on none or too far apart.

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
