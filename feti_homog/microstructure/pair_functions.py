"""How fibres are placed about each other, pair by pair: g(r), Ripley's K(r) and L(r), directions of pairs."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, sqrt

import numpy as np

from feti_homog.microstructure.fibre_pattern import FibrePattern
from feti_homog.typing import Float

# The longest distance of pair functions, in mean spacings 1 / sqrt(fibres per area): beyond, g is 1 in random cells.
FAR = 10.0
# Steps of the distance, in mean radii.
STEP = 0.2
SECTORS = 12


@dataclass(frozen=True)
class PairFunctions:
    """Functions of the distance between centres.

    Attributes:
        r: (m,) distances, in equal steps; the first one is one step.
        ripley_k: (m,) K(r), mean number of other fibres within r of one / number of fibres per area.
        radial: (m,) radial distribution function g in the step that ends at r: K's growth / the area of the ring.
    """

    r: Float
    ripley_k: Float
    radial: Float

    @property
    def ripley_l(self) -> Float:
        """(m,) L(r) = sqrt(K / pi), which is r for complete spatial randomness."""
        return np.asarray(np.sqrt(self.ripley_k / pi))


def distances(pattern: FibrePattern) -> Float:
    """(m,) distances of the pair functions: up to half of the shorter side and at most `FAR` mean spacings."""
    reach = min(float(pattern.size.min()) / 2, FAR * sqrt(pattern.area / pattern.count))
    steps = max(10, round(reach / (STEP * pattern.mean_radius)))
    return np.asarray(reach * np.arange(1, steps + 1) / steps)


def pair_functions(pattern: FibrePattern, r: Float) -> PairFunctions:
    """K(r) = A / (N (N - 1)) sum_{i != j} w_ij [|x_i - x_j| <= r] at the distances r (m,), and g = K' / (2 pi r).

    In a periodic cell w = 1, and r is at most half of the shorter side, up to which pairs have one image each; in a
    window w_ij = A / ((width - |dx|) (height - |dy|)), the translation correction [Ohser & Stoyan 1981], which keeps K
    and g unbiased.  Needs two fibres.
    """
    vectors = pattern.pair_vectors(float(r[-1]))
    place = np.searchsorted(r, np.hypot(*vectors.T))  # of the least r that is not below the distance
    place = np.minimum(place, len(r) - 1)  # of a distance that rounding put beyond the last
    shares = np.bincount(place, _translation_weights(pattern, vectors), len(r))
    growth = shares * (pattern.area / (pattern.count * (pattern.count - 1)))
    rings = pi * np.diff(r * r, prepend=0.0)
    return PairFunctions(r, np.cumsum(growth), growth / rings)


def pair_directions(pattern: FibrePattern, reach: float) -> Float:
    """(SECTORS,) share of the pairs at most `reach` apart in each sector of directions / that of all directions alike.

    Sectors of 180 / SECTORS degrees, the first about x1, the others in order towards x2; a pair has no front and back.
    Pairs of a window have the weights of `pair_functions`.  All are 0 if no two fibres are that near.
    """
    vectors = pattern.pair_vectors(reach)
    angle = np.degrees(np.arctan2(vectors[:, 1], vectors[:, 0]))
    sector = np.floor(angle * SECTORS / 180 + 0.5).astype(int) % SECTORS
    shares = np.bincount(sector, _translation_weights(pattern, vectors), SECTORS)
    return np.asarray(SECTORS * shares / (shares.sum() or 1.0))


def _translation_weights(pattern: FibrePattern, vectors: Float) -> Float:
    """(k,) 1 / the share of the places of the window at which a pair with this vector fits in."""
    if pattern.periodic:
        return np.ones(len(vectors))
    return np.asarray(pattern.area / np.prod(pattern.size - np.abs(vectors), axis=1))
