"""Rounded polygons among the fibres of a table: rows with `sides`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from feti_homog.typing import Float, Int

SIDES = 3, 12
"""The fewest and the most."""


@dataclass(frozen=True)
class RoundedPolygons:
    """Regular polygons whose corners are rounded; of N fibres, some of them.

    Attributes:
        sides: (N,) 0 of other fibres.
        circumradius: (N,) of the corners as if they were sharp.
        rounding: (N,) radius of the circles that touch both sides at a corner.
        angle: (N,) of the first corner, in degrees from x.
    """

    sides: Int
    circumradius: Float
    rounding: Float
    angle: Float

    def __getitem__(self, rows: Int) -> RoundedPolygons:
        return RoundedPolygons(self.sides[rows], self.circumradius[rows], self.rounding[rows], self.angle[rows])

    @property
    def corner(self) -> Float:
        """(N,) rounding / radius of the circle within the sides."""
        inner = self.circumradius * np.cos(np.pi / np.maximum(self.sides, SIDES[0]))
        return np.where(self.sides > 0, self.rounding / inner, 0.0)

    @property
    def areas(self) -> Float:
        """(N,) of the polygon of the rounding circles' centres, with a margin of that radius around."""
        count = np.maximum(self.sides, SIDES[0])
        core = self.circumradius - self.rounding / np.cos(np.pi / count)
        side = 2 * core * np.sin(np.pi / count)
        inside = count * core**2 * np.sin(2 * np.pi / count) / 2
        return np.asarray(inside + count * side * self.rounding + np.pi * self.rounding**2)
