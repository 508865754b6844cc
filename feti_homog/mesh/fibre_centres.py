"""Centres and radii of the fibres; directions on their interfaces are measured about the centres.  On rank 0."""

from __future__ import annotations

import numpy as np

from feti_homog.mesh.coarse_mesh import areas
from feti_homog.mesh.periodic_topology import Torus
from feti_homog.mesh.submesh import Submesh, cut_bodies
from feti_homog.mesh.unwrap import unwrap
from feti_homog.typing import Float

# Relative to the radius: circles nearer than this are images of one.
SAME_CIRCLE = 1e-9


def fibre_circles(torus: Torus) -> Float:
    """(constituents, 3) centre and radius of each fibre's circle, of a coating the outer one; any image of it.

    The centre of a fibre that is not round is that of its area, or the one that the mesh knows, and its radius NaN.
    NaN for the matrix, and for a fibre that winds around the torus, which has no centre.
    """
    circles = _discs(torus)
    others = np.isnan(circles[torus.constituent, 2]) & (torus.constituent_phase[torus.constituent] > 0)
    for submesh in cut_bodies(torus, np.flatnonzero(others)):
        circles[submesh.body] = _centre_of_area(submesh)
    if torus.mesh.centres is not None:
        body, first = np.unique(torus.constituent, return_index=True)
        number = torus.mesh.precedence[first]
        known = np.isnan(circles[body, 2]) & (number > 0)
        circles[body[known], :2] = torus.mesh.centres[(number[known] - 1) % len(torus.mesh.centres)]
    return circles


def _discs(torus: Torus) -> Float:
    """(constituents, 3) the largest circle of those whose boundary is on one circle, or on several around one centre;
    NaN of others."""
    edge, body = torus.triangle_torus_edges, torus.constituent
    left, right, between = torus.sides
    outer = torus.at_void.copy()
    outer[between] = body[left] != body[right]
    triangle, k = np.nonzero(outer[edge])
    own, around = body[triangle], torus.edge_circles[torus.triangle_edges[triangle, k]]
    n = len(torus.constituent_phase)
    order = np.lexsort((torus.triangle_edges[triangle, k], -np.nan_to_num(around[:, 2]), own))
    bodies, first = np.unique(own[order], return_index=True)
    circles = np.full((n, 3), np.nan)
    circles[bodies] = around[order[first]]
    offset = around[:, :2] - circles[own, :2]
    offset -= np.round(offset / torus.mesh.period) * torus.mesh.period
    on_one = (around[:, 2] > 0) & np.all(np.abs(offset) < SAME_CIRCLE * circles[own, 2:], axis=1)
    is_disc = torus.constituent_phase > 0
    is_disc[own[~on_one]] = False
    circles[~is_disc] = np.nan
    return circles


def _centre_of_area(submesh: Submesh) -> Float:
    """(3,) that of a fibre, and NaN for the radius."""
    shift, closes = unwrap(submesh)
    if not closes:
        return np.full(3, np.nan)
    middles = submesh.points[submesh.triangles].mean(axis=1) + shift
    weights = areas(submesh.points, submesh.triangles.astype(np.int32))
    return np.asarray(np.r_[np.average(middles, axis=0, weights=weights), np.nan])
