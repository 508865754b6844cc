"""Where the sides of a cell pass clear of its fibres: the choice among places that are about as good.

In cells with a symmetry, as any two discs have, several are as good but for rounding: it is the first of them, so that
the choice does not hang on the unit of length.
"""

from __future__ import annotations

import numpy as np

from feti_homog.typing import Float

# Decimals in which lengths / width of the cell are compared.
DECIMALS = 10
# Gaps that are looked at, and the narrowest of them / the widest.
MOST_GAPS, NARROWEST = 4, 0.7


def widest_gaps(touching: Float, period: float) -> Float:
    """Middles (m,) of the widest gaps between positions (k,) at which a side touches something."""
    places = np.sort(touching % period)
    gaps = np.diff(places, append=places[0] + period)
    wide = np.argsort(-gaps.round(DECIMALS), kind="stable")[:MOST_GAPS]
    wide = wide[gaps[wide] > NARROWEST * gaps[wide[0]]]
    return np.asarray(places[wide] + gaps[wide] / 2)


def farthest(corners: Float, distances: Float) -> Float:
    """The corner (2,) of those (c, 2) with the largest of these distances (c,)."""
    return np.asarray(corners[np.argmax(distances.round(DECIMALS))])
