"""Normals and lengths along the coarse edges of interfaces, which are straight or arcs of ellipses."""

from __future__ import annotations

import numpy as np
from scipy.special import roots_legendre

from feti_homog.typing import Float

# Gauss points of one side of an element, on arcs that the mesh follows well.
POINTS, WEIGHTS = roots_legendre(4)


def along(ends: Float, turn: Float, place: Float) -> Float:
    """(k, 2) at the places s (k,) in [0, 1] of edges what is dx / ds, turned or not, at their ends (k, 2, 2).

    On the arc of an ellipse along which the parameter turns by `turn` (k,), it obeys y'' = -turn^2 y; where the edge is
    straight, it is linear, for `turn` is 0.
    """
    sine = np.where(turn > 0, np.sin(turn), 1.0)
    of_start = np.where(turn > 0, np.sin((1 - place) * turn), 1 - place) / sine
    of_stop = np.where(turn > 0, np.sin(place * turn), place) / sine
    return np.asarray(of_start[:, None] * ends[:, 0] + of_stop[:, None] * ends[:, 1])


def mean_speed(ends: Float, turn: Float, low: Float, high: Float) -> Float:
    """(k,) the means of |dx / ds| from the places `low` to `high` (k,), by Gauss's rule; arguments as of `along`."""
    places = (low[:, None] * (1 - POINTS) + high[:, None] * (1 + POINTS)) / 2
    speeds = [np.hypot(*along(ends, turn, place).T) for place in places.T]
    return np.asarray(np.stack(speeds, axis=1) @ WEIGHTS / 2)
