"""Semi-axes of the fibres that are circles or ellipses.  On rank 0."""

from __future__ import annotations

import numpy as np

from feti_homog.mesh.periodic_topology import Torus
from feti_homog.typing import Float

# Relative to the longer semi-axis: ellipses with centres nearer than this are images of one, or one within another.
SAME_CENTRE = 1e-9


def fibre_frames(torus: Torus) -> Float:
    """(constituents, 2, 2) frame F of the ellipse c + F p, |p| = 1, around each fibre, of a coating the outer one.

    NaN for the matrix, and for fibres whose boundary is not on ellipses about one centre.
    """
    edge, body = torus.triangle_edges.ravel(), np.repeat(torus.constituent, 3)
    low, high = np.full(torus.torus_edge.max() + 1, body.max()), np.zeros(torus.torus_edge.max() + 1, np.int64)
    np.minimum.at(low, torus.torus_edge[edge], body)
    np.maximum.at(high, torus.torus_edge[edge], body)
    is_border = ((low != high) | torus.at_void)[torus.torus_edge[edge]]
    edge, body = edge[is_border], body[is_border]
    ellipses = torus.edge_ellipses
    area = np.abs(np.linalg.det(ellipses.frames))
    order = np.lexsort((-area[edge], body))
    bodies, first, place = np.unique(body[order], return_index=True, return_inverse=True)
    edge = edge[order]
    outer = ellipses[edge[first]]
    period = torus.mesh.period
    offset = (ellipses.centres[edge] - outer.centres[place] + period / 2) % period - period / 2
    away = (area[edge] == 0) | (np.linalg.norm(offset, axis=1) > SAME_CENTRE * outer.longest[place])
    is_other = np.bincount(place, away, len(bodies)) > 0
    frames = np.full((len(torus.constituent_phase), 2, 2), np.nan)
    known = ~is_other & (torus.constituent_phase[bodies] > 0)
    frames[bodies[known]] = outer.frames[known]
    return frames
