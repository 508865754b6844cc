"""Centres of the fibres, about which directions on their interfaces are measured; on rank 0."""

from __future__ import annotations

import numpy as np

from feti_homog.cell.coarse_mesh import areas
from feti_homog.cell.periodic_topology import Torus
from feti_homog.cell.submesh import Piece, cut
from feti_homog.cell.unwrap import unwrap
from feti_homog.typing import Float

# Relative to the radius: circles nearer than this are images of one.
SAME = 1e-9


def fibre_centres(torus: Torus) -> Float:
    """(constituents, 2) centre of each fibre's circle or, if it is not round, of its area; any image of it.

    NaN for the matrix, and for a fibre that winds around the torus, which has no centre.
    """
    centres = np.full((len(torus.constituent_phase), 2), np.nan)
    for piece in cut(torus, torus.constituent):
        if torus.constituent_phase[piece.body] > 0:
            centres[piece.body] = _centre(piece)
    return centres


def _centre(piece: Piece) -> Float:
    around = _boundary_circles(piece)
    radius = around[0, 2] if len(around) else 0.0
    offset = around[:, :2] - around[:1, :2]
    offset -= np.round(offset / piece.period) * piece.period
    if radius > 0 and np.all(np.abs(around[:, 2] - radius) < SAME * radius) and np.all(np.abs(offset) < SAME * radius):
        return np.asarray(around[0, :2])
    shift, closes = unwrap(piece)
    if not closes:
        return np.full(2, np.nan)
    middles = piece.points[piece.triangles].mean(axis=1) + shift
    return np.asarray(np.average(middles, axis=0, weights=areas(piece.points, piece.triangles.astype(np.int32))))


def _boundary_circles(piece: Piece) -> Float:
    """(b, 3) circles of the edges that the piece has on one side only, radius 0 where they are straight."""
    sides = np.bincount(piece.edge_class[piece.triangle_edges].ravel(), minlength=len(piece.edge_keys))
    return piece.circles[sides[piece.edge_class] == 1]
