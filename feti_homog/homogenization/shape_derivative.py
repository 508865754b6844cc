"""Motion of the nodes where the fibres of a pattern grow: V = dx / d ln R.

It is x - c in a fibre of centre c and radius R, and around it falls to nothing halfway to the next fibre.  The fields
of unit loads make the energy stationary, so by the fraction f, d f / d ln R = 2 f, a stiffness has the derivative of
the energies on the mesh that moves, at fixed nodal u - E x: exact for that mesh, whatever V is between the fibres.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from feti_homog.case.case import Case
from feti_homog.homogenization.domain_partition import CellSummary
from feti_homog.typing import Float

PATTERNS = ("square", "hexagonal")
ON_CIRCLE = 1e-9  # of the radius
IMAGES = np.stack(np.meshgrid([-1, 0, 1], [-1, 0, 1]), axis=-1).reshape(-1, 2)


def fractions(case: Case) -> Iterator[float]:
    """Yield the fraction of equal fibres in a pattern, bonded to the matrix without a coating; none of other cells."""
    cell = case.cell
    if cell.geometry in PATTERNS and cell.coating is None and not case.interfaces and cell.fibre_fraction is not None:
        yield cell.fibre_fraction


def velocity(points: Float, cell: CellSummary) -> Float:
    """(n, 2) V at points (n, 2)."""
    period = np.array([cell.width, cell.height])
    centres, radii = cell.centres[cell.is_fibre], cell.radii[cell.is_fibre]
    found = np.zeros_like(points)
    for number, (centre, radius) in enumerate(zip(centres, radii, strict=True)):
        gaps = np.linalg.norm(centres[:, None] + IMAGES * period - centre, axis=2) - radii[:, None] - radius
        gaps[number, (IMAGES == 0).all(axis=1)] = np.inf
        reach = gaps.min() / 2  # so that no two fibres move a node
        away = points - centre
        away -= period * np.round(away / period)
        distance = np.linalg.norm(away, axis=1, keepdims=True)
        share = np.clip((radius + reach - distance) / reach, 0.0, 1.0) * radius / np.maximum(distance, radius)
        found += away * np.where(distance <= radius * (1 + ON_CIRCLE), 1.0, share)
    return found
