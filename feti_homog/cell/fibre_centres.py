"""Centres and radii of the fibres; directions on their interfaces are measured about the centres.  On rank 0."""

from __future__ import annotations

import numpy as np

from feti_homog.cell.coarse_mesh import areas
from feti_homog.cell.periodic_topology import Torus
from feti_homog.cell.submesh import Submesh, cut
from feti_homog.cell.unwrap import unwrap
from feti_homog.typing import Float

# Relative to the radius: circles nearer than this are images of one.
SAME_CIRCLE = 1e-9


def fibre_circles(torus: Torus) -> Float:
    """(constituents, 3) centre and radius of each fibre's circle, of a coating the outer one; any image of it.

    The centre of a fibre that is not round is that of its area, or the one that the mesh knows, and its radius NaN.
    NaN for the matrix, and for a fibre that winds around the torus, which has no centre.
    """
    circles = np.full((len(torus.constituent_phase), 3), np.nan)
    for submesh in cut(torus, torus.constituent):
        if torus.constituent_phase[submesh.body] > 0:
            circles[submesh.body] = _circle(submesh)
    if torus.mesh.centres is not None:
        body, first = np.unique(torus.constituent, return_index=True)
        number = torus.mesh.precedence[first]
        known = np.isnan(circles[body, 2]) & (number > 0)
        circles[body[known], :2] = torus.mesh.centres[(number[known] - 1) % len(torus.mesh.centres)]
    return circles


def _circle(submesh: Submesh) -> Float:
    """(3,) that of one fibre."""
    around = _boundary_circles(submesh)
    if len(around) and around[:, 2].min() > 0:
        outer = around[np.argmax(around[:, 2])]
        offset = around[:, :2] - outer[:2]
        offset -= np.round(offset / submesh.period) * submesh.period
        if np.all(np.abs(offset) < SAME_CIRCLE * outer[2]):
            return np.asarray(outer)
    shift, closes = unwrap(submesh)
    if not closes:
        return np.full(3, np.nan)
    middles = submesh.points[submesh.triangles].mean(axis=1) + shift
    weights = areas(submesh.points, submesh.triangles.astype(np.int32))
    return np.asarray(np.r_[np.average(middles, axis=0, weights=weights), np.nan])


def _boundary_circles(submesh: Submesh) -> Float:
    """(b, 3) circles of the edges that the piece has on one side only, radius 0 where they are straight."""
    sides = np.bincount(submesh.edge_class[submesh.triangle_edges].ravel(), minlength=len(submesh.edge_keys))
    return np.asarray(submesh.circles[sides[submesh.edge_class] == 1])
