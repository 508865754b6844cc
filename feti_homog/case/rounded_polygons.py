"""Rounded polygons among the fibres of a table: rows with `sides`."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from feti_homog.typing import Bool, Float, Int

if TYPE_CHECKING:
    from feti_homog.case.fibre_table import FibreTable

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


def with_polygons(table: FibreTable, window: str, faults: list[str]) -> FibreTable:
    """The table with its polygons, whose radii become those of discs of the same area; faults are added to `faults`."""
    if table.sides is None:
        if table.corner is not None:
            faults.append(f"[cell] {table.name}: corner: belongs to sides, which no fibre has")
        return table
    sides = np.nan_to_num(table.sides)
    given, corner = sides != 0, np.zeros(len(sides)) if table.corner is None else table.corner
    least, most = SIDES
    _tell(table, given & ((sides != np.round(sides)) | (sides < least) | (sides > most)),
          f"expected sides from {least} to {most}, a whole number, or 0", faults)  # fmt: skip
    _tell(table, given & (corner > 1), "expected corner at most 1, which makes a circle", faults)
    _tell(table, ~given & (corner > 0), "has a corner, but no sides", faults)
    for name in ("a", "coating", "inner_radius"):
        column = getattr(table, name)
        if column is not None:
            _tell(table, given & (np.nan_to_num(column) > 0), f"has sides and {name}; give one", faults)
    if given.any() and window == "cut":
        faults.append(f'[cell] window = "cut": {table.name} has polygons, which it does not move')
    if faults or not given.any():
        return replace(table, sides=None, corner=None)
    number = sides.astype(np.intp)
    inner = table.radius * np.cos(np.pi / np.maximum(number, least))
    angle = np.zeros(len(sides)) if table.angle is None else table.angle
    polygons = RoundedPolygons(number, table.radius, np.where(given, corner * inner, 0.0), angle)
    return replace(table, radius=np.where(given, np.sqrt(polygons.areas / np.pi), table.radius), polygons=polygons)


def _tell(table: FibreTable, are_faulty: Bool, words: str, faults: list[str]) -> None:
    faults += [f"[cell] {table.name}: row {row}: {words}" for row in table.row[are_faulty].tolist()]
