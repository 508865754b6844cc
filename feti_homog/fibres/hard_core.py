"""Random patterns of fibres that do not overlap, with the radii and the gap of a measured one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from feti_homog.errors import MeshError
from feti_homog.fibres.relaxation import MAX_STEPS, relax
from feti_homog.microstructure.fibre_pattern import FibrePattern

ATTEMPTS = 3
# Area fraction of discs grown by half the gap above which there are no random patterns.
DENSEST = 0.9


def hard_core(pattern: FibrePattern, generator: np.random.Generator, max_steps: int = MAX_STEPS) -> FibrePattern:
    """Return the same fibres elsewhere, as those of random cells are placed (`random_arrangement`): no gap is
    smaller than the smallest one of the pattern. Across the sides of a window they are placed as in a periodic
    cell.

    Raises:
        MeshError: no such pattern is found.
    """
    try:
        return placed(pattern, max(pattern.smallest_gap, 0.0), generator, max_steps)
    except MeshError as error:
        raise MeshError(f"{error}; compare with --model poisson") from error


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
