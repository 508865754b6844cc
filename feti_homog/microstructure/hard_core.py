"""Random discs that do not overlap: moved until they do not, or with radii and gap of a measured pattern."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from feti_homog.errors import MeshError
from feti_homog.microstructure.arrangement import neighbours
from feti_homog.microstructure.fibre_pattern import FibrePattern
from feti_homog.microstructure.neighbour_match import match_distance, wanted_distances
from feti_homog.typing import Float, Int

# Relative excess of the radii that push over those that must not overlap: the descent ends in finite time.
RADIUS_EXCESS = 1e-3
# Steps of the descent after which an arrangement counts as jammed; found ones take less than 200.
MAX_STEPS = 2000
ATTEMPTS = 3
# Area fraction of discs grown by half the gap above which there are no random patterns.
DENSEST = 0.9


def relax(centres: Float, radii: Float, max_steps: int, size: tuple[float, float] = (1.0, 1.0)) -> tuple[Float, float]:
    """Centres (N, 2) moved until discs on the torus of periods `size` do not overlap, and the clearance reached.

    The clearance is the smallest ratio of distance to sum of radii; at least 1 is success. Heavy-ball descent
    x += 0.25 f + 0.9 dx: no reductions over the discs, so that every machine gets the same numbers.
    """
    periods, target = np.array(size), radii * (1 + RADIUS_EXCESS)
    step, clearance = np.zeros_like(centres), 0.0
    for _ in range(max_steps):
        first, second, vector = neighbours(centres, periods, 2 * target.max())
        distance = np.sqrt(vector[:, 0] * vector[:, 0] + vector[:, 1] * vector[:, 1])
        clearance = float(np.min(distance / (radii[first] + radii[second]), initial=2.0))
        if clearance >= 1:
            break
        overlap = np.maximum(target[first] + target[second] - distance, 0.0)
        push = (overlap / np.maximum(distance, 1e-9))[:, None] * vector
        step = 0.25 * (_sum_at(second, push, len(radii)) - _sum_at(first, push, len(radii))) + 0.9 * step
        centres = (centres + step) % periods
    return centres, clearance


def _sum_at(rows: Int, vectors: Float, count: int) -> Float:
    """Return sums (count, 2) of the vectors (k, 2) of each row, added one after the other."""
    return np.stack([np.bincount(rows, vectors[:, axis], count) for axis in (0, 1)], axis=1)


def placed(
    pattern: FibrePattern, gap: float, generator: np.random.Generator, max_steps: int = MAX_STEPS
) -> FibrePattern:
    """Return the same fibres at random places at least `gap` from each other. Raises MeshError if none are found."""
    grown = pattern.radii + gap / 2
    attempts = ATTEMPTS if np.pi * np.sum(grown**2) < DENSEST * pattern.area else 0
    for _ in range(attempts):
        places = generator.random((pattern.count, 2)) * pattern.size
        centres, clearance = relax(places, grown, max_steps, (pattern.width, pattern.height))
        if clearance >= 1:
            return replace(pattern, centres=centres)
    words = f"with the fibre fraction {pattern.fibre_fraction:.4g} and the smallest gap {gap:.4g}"
    raise MeshError(f"no random pattern {words} is found")


def distance_of(window: FibrePattern, width: float, height: float, centres: Float, radii: Float) -> float:
    """Return how far a periodic cell with these fibres is from the window that it matches, in mean diameters."""
    pattern = FibrePattern(width, height, centres, radii, periodic=True)
    return match_distance(pattern, wanted_distances(window, pattern.count))
