"""A window cut from a micrograph, made periodic: fibres that overlap across its border are moved apart."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from feti_homog.errors import MeshError
from feti_homog.microstructure.arrangements import neighbours
from feti_homog.microstructure.shapes.outlines import Outlines
from feti_homog.typing import Float, Int

# Gap / sum of the radii of fibres across the border, at least and at most.
LEAST_GAP, MOST_GAP = 0.01, 0.05
# Overlap / sum of the radii that counts as none; distances are made larger by it.
TOLERANCE = 1e-6
# Moves differ from the smallest ones by less than this, / mean radius.
SETTLED = 1e-4
MAX_STEPS = 100


@dataclass(frozen=True)
class _Pairs:
    """Fibres `first` and `second` (k,), the latter moved by `shift` (k, 2) periods, and least gaps (k,)."""

    first: Int
    second: Int
    shift: Float
    least: Float

    def joined(self, other: _Pairs) -> _Pairs:
        """Return all pairs from both, each once."""
        both = (self, other)
        keys = np.concatenate([np.column_stack([pairs.first, pairs.second, np.round(pairs.shift)]) for pairs in both])
        once = np.unique(keys, axis=0, return_index=True)[1]
        least = np.concatenate([self.least, other.least])[once]
        return _Pairs(keys[once, 0].astype(np.intp), keys[once, 1].astype(np.intp), keys[once, 2:], least)

    def where(self, chosen: np.ndarray[tuple[int, ...], np.dtype[np.bool_]]) -> _Pairs:
        return _Pairs(self.first[chosen], self.second[chosen], self.shift[chosen], self.least[chosen])

    def vectors(self, centres: Float, size: Float) -> Float:
        """Return the vectors (k, 2) from the first fibres to the second."""
        return np.asarray(centres[self.second] - centres[self.first] + self.shift * size)


# As `Outlines.parting`.
Parting = Callable[[Int, Int, Float], tuple[Float, Float]]


def moves(outlines: Outlines, size: Float) -> Float:
    """Return the moves d (N, 2) that part outlines overlapping across the torus border.

    The torus has the periods `size` (2,). The moves are a local minimum of sum |d|^2 such that no gap becomes less than
    the smallest gap within the border. Gaps are relative to the sum of the radii, and the smallest one is taken between
    LEAST_GAP and MOST_GAP. Each step replaces the distances |v| >= r by n . v >= r, with the present directions n;
    since n . v <= |v|, its solution keeps the distances.

    Outlines that are no discs have radii of equal-area discs; n is the direction of the largest n . v - r, the gap,
    where r is the reach of both along n.

    Raises:
        MeshError: there is no room.
    """
    centres, radii, parting = outlines.centres, outlines.radii, outlines.parting
    reach = 3 * float(outlines.longest.max())
    first, second, vector = neighbours(centres, size, reach)
    across = np.abs(centres[second] - centres[first] - vector).max(axis=1) > TOLERANCE * radii.mean()
    normal, least = parting(first, second, vector)
    within = (((normal * vector).sum(axis=1) - least) / (radii[first] + radii[second]))[~across]
    gap, moved = float(np.clip(within.min(initial=MOST_GAP), LEAST_GAP, MOST_GAP)), np.zeros_like(centres)
    empty = np.zeros(0, np.intp)
    pairs = _Pairs(empty, empty, np.zeros((0, 2)), np.zeros(0))
    for _ in range(MAX_STEPS):
        # Different fibres that are, or soon may be, nearer than they must be.
        first, second, vector = neighbours(centres + moved, size, reach)
        differ = first != second
        first, second, vector = first[differ], second[differ], vector[differ]
        shift = np.round((vector - (centres + moved)[second] + (centres + moved)[first]) / size)
        vector = centres[second] - centres[first] + shift * size
        normal, least = parting(first, second, vector)
        before, target = (normal * vector).sum(axis=1) - least, (radii[first] + radii[second]) * gap
        near = _Pairs(first, second, shift, np.where(shift.any(axis=1), target, np.minimum(before, target)))
        present = near.vectors(centres + moved, size)
        normal, least = parting(near.first, near.second, present)
        short = near.where((normal * present).sum(axis=1) < (least + near.least) * (1 - TOLERANCE))
        last, pairs = moved, pairs.joined(short)
        moved = _least_moves(pairs, centres, moved, size, float(radii.mean()), parting)
        if len(short.first) == 0 and np.abs(moved - last).max() < SETTLED * radii.mean():
            return moved
    raise MeshError("there is no room to move them apart")


def _least_moves(pairs: _Pairs, centres: Float, moved: Float, size: Float, unit: float, parting: Parting) -> Float:
    """Return the d (N, 2) of least sum |d|^2 that keep all pairs apart.

    They have n . (v + d_second - d_first) >= r, with the present directions n.

    By non-negative least squares: C. L. Lawson, R. J. Hanson, Solving Least Squares Problems, 1974, chapter 23.
    """
    result = np.zeros_like(centres)
    if len(pairs.first) == 0:
        return result
    normal, reach = parting(pairs.first, pairs.second, pairs.vectors(centres + moved, size))
    fibres, place = np.unique(np.concatenate([pairs.first, pairs.second]), return_inverse=True)
    rows, count = np.arange(len(normal)), len(normal)
    matrix = np.zeros((2 * len(fibres) + 1, count))
    for axis in (0, 1):
        matrix[2 * place[:count] + axis, rows] -= normal[:, axis]
        matrix[2 * place[count:] + axis, rows] += normal[:, axis]
    needed = (reach + pairs.least) * (1 + TOLERANCE) - (normal * pairs.vectors(centres, size)).sum(axis=1)
    matrix[-1] = needed / unit
    target = np.zeros(len(matrix))
    target[-1] = 1.0
    residual = matrix @ nnls(matrix, target, maxiter=100 * count)[0] - target
    if abs(residual[-1]) < TOLERANCE:
        raise MeshError("there is no room to move them apart")
    result[fibres] = (-residual[:-1] / residual[-1]).reshape(-1, 2) * unit
    return result
