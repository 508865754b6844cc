"""Make a window of a micrograph periodic: move apart the fibres that overlap across the border."""

import numpy as np
from scipy.optimize import nnls

from feti_homog.errors import MeshError
from feti_homog.microstructure.arrangements import neighbours
from feti_homog.microstructure.shapes import Outlines
from feti_homog.typing import Float

# Least and largest ratio of gap to radius sum for fibres across the border.
LEAST_GAP, MOST_GAP = 0.01, 0.05
# Overlap / radius sum that counts as no overlap; required distances are larger by this fraction.
TOLERANCE = 1e-6
# Change of the moves in one step, in mean radii, below which the moves are final.
SETTLED = 1e-4
MAX_STEPS = 100


def moves(outlines: Outlines, size: Float) -> Float:
    """Compute the moves d (N, 2) that separate outlines across the border of the torus.

    The torus has the periods `size` (2,). The moves are a local minimum of sum |d|^2. Gaps across the border become at
    least the smallest gap inside the window, clipped to the range LEAST_GAP to MOST_GAP; gaps inside stay at least as
    large as this gap or, if they are smaller, do not shrink. Gaps are relative to the sum of the radii. Each step
    replaces the constraints |v| >= r, with the vector v between two centres and r the sum of radii and gap, by
    n . v >= r, with the present direction n; since n . v <= |v|, the solution satisfies the constraints. For outlines
    other than discs, n is the direction of the largest gap, and r the sum of gap and both supports along n.  Raises
    MeshError if the torus has no room for such moves, or if they do not settle in MAX_STEPS steps.
    """
    centres, radii, parting = outlines.centres, outlines.radii, outlines.parting
    reach, unit = 3 * float(outlines.longest.max()), float(radii.mean())
    first, second, vector = neighbours(centres, size, reach)
    across = np.abs(centres[second] - centres[first] - vector).max(axis=1) > TOLERANCE * unit
    normal, least = parting(first, second, vector)
    within = (((normal * vector).sum(axis=1) - least) / (radii[first] + radii[second]))[~across]
    gap = float(np.clip(within.min(initial=MOST_GAP), LEAST_GAP, MOST_GAP))
    moved, pairs = np.zeros_like(centres), np.zeros((0, 5))
    for _ in range(MAX_STEPS):
        # Pairs of different fibres that are closer than allowed, or may become so.
        places = centres + moved
        first, second, vector = neighbours(places, size, reach)
        differ = first != second
        first, second, vector = first[differ], second[differ], vector[differ]
        shift = np.round((vector - places[second] + places[first]) / size)
        vector = centres[second] - centres[first] + shift * size
        normal, least = parting(first, second, vector)
        before, target = (normal * vector).sum(axis=1) - least, (radii[first] + radii[second]) * gap
        needed = np.where(shift.any(axis=1), target, np.minimum(before, target))
        present = places[second] - places[first] + shift * size
        normal, least = parting(first, second, present)
        short = (normal * present).sum(axis=1) < (least + needed) * (1 - TOLERANCE)
        # A row for each pair that was too close in any step: both fibres, periods between them, least gap.
        pairs = np.concatenate([pairs, np.column_stack([first, second, shift, needed])[short]])
        pairs = pairs[np.unique(pairs[:, :4], axis=0, return_index=True)[1]]
        last = moved
        if len(pairs):
            moved = _least_moves(outlines, pairs, moved, size)
        if not short.any() and np.abs(moved - last).max() < SETTLED * unit:
            return moved
    raise MeshError("there is no room to move them apart")


def _least_moves(outlines: Outlines, pairs: Float, moved: Float, size: Float) -> Float:
    """Return the moves d (N, 2) of least sum |d|^2 that keep all pairs (k, 5) apart.

    A row of `pairs` has two fibres, the periods between them, and a least gap. Moves satisfy
    n . (v + d_second - d_first) >= r, with the vector v between the centres, the direction n after the moves `moved`,
    and r from `parting` plus the gap. Raises MeshError without a solution.  Non-negative least squares: C. L. Lawson,
    R. J. Hanson, Solving Least Squares Problems, 1974, chapter 23.
    """
    centres, unit, count = outlines.centres, float(outlines.radii.mean()), len(pairs)
    ends = pairs[:, :2].T.astype(np.intp)
    vector, present = (at[ends[1]] - at[ends[0]] + pairs[:, 2:4] * size for at in (centres, centres + moved))
    normal, reach = outlines.parting(ends[0], ends[1], present)
    fibres, place = np.unique(ends, return_inverse=True)
    matrix = np.zeros((2 * len(fibres) + 1, count))
    for axis in (0, 1):
        for sign, row in zip((-1, 1), place.reshape(2, -1), strict=True):
            matrix[2 * row + axis, np.arange(count)] += sign * normal[:, axis]
    matrix[-1] = ((reach + pairs[:, 4]) * (1 + TOLERANCE) - (normal * vector).sum(axis=1)) / unit
    target = np.zeros(len(matrix))
    target[-1] = 1.0
    residual = matrix @ nnls(matrix, target, maxiter=100 * count)[0] - target
    if abs(residual[-1]) < TOLERANCE:
        raise MeshError("there is no room to move them apart")
    result = np.zeros_like(centres)
    result[fibres] = (-residual[:-1] / residual[-1]).reshape(-1, 2) * unit
    return result
