"""Shapes of the fibres of a table: every fibre gets a radius, and semi-axes or a polygon if some are not round."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from feti_homog.case.fibre_table import FibreTable
from feti_homog.case.rounded_polygons import SIDES, RoundedPolygons
from feti_homog.typing import Bool, Float

BOTH_SIZES = "has a radius and semi-axes; give one"
# Shorter / longer semi-axis of a fibre, at least: elements at the tips would be too small.
THINNEST = 0.05
# Inner / outer radius of hollow fibres.
WIDEST_CORE = 0.05, 0.98
HOLLOW_WORDS = f"expected inner_radius / radius from {WIDEST_CORE[0]:g} to {WIDEST_CORE[1]:g}, or 0"


def with_shapes(table: FibreTable, faults: list[str]) -> FibreTable:
    """The table whose radii sqrt(a b) are those of discs of the same area, and whose discs have semi-axes too.

    Semi-axes are None if all fibres are round. Faults are added to `faults`.
    """
    if table.a is None or table.b is None:
        return replace(table, a=None, b=None, angle=None)
    is_round = np.isnan(table.a)
    a, b = np.where(is_round, table.radius, table.a), np.where(is_round, table.radius, table.b)
    angle = np.zeros(len(a)) if table.angle is None else table.angle
    _tell(table, have_both_sizes(table), BOTH_SIZES, faults)
    thin = np.minimum(a, b) < THINNEST * np.maximum(a, b)
    _tell(table, thin, f"expected a / b from {THINNEST:g} to {1 / THINNEST:g}", faults)
    is_oval = a != b
    if not is_oval.any():
        return replace(table, radius=a, a=None, b=None, angle=None)
    return replace(table, radius=equal_area_radii(table), a=a, b=b, angle=np.where(is_oval, angle, 0.0))


def have_both_sizes(table: FibreTable) -> Bool:
    """(N,) which rows are faulty: they have a radius and semi-axes."""
    return np.zeros(len(table.row), bool) if table.a is None else ~np.isnan(table.a) & ~np.isnan(table.radius)


def equal_area_radii(table: FibreTable) -> Float:
    """(N,) radii of discs of the same area: sqrt(a b) of ellipses."""
    if table.a is None or table.b is None:
        return table.radius
    return np.where(np.isnan(table.a), table.radius, np.where(table.a == table.b, table.a, np.sqrt(table.a * table.b)))


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


def check_hollow(table: FibreTable, faults: list[str]) -> None:
    """Add faults of hollow fibres to `faults`."""
    if table.inner_radius is None:
        return
    hollow, inner = table.inner_radius > 0, table.inner_radius / table.radius
    _tell(table, hollow & ((inner < WIDEST_CORE[0]) | (inner > WIDEST_CORE[1])), HOLLOW_WORDS, faults)
    _tell(table, hollow & (table.outer_radius > table.radius), "has an inner_radius and a coating; give one", faults)
    if table.a is not None:
        _tell(table, hollow & (table.a != table.b), "has an inner_radius, which only round fibres may have", faults)


def _tell(table: FibreTable, are_faulty: Bool, words: str, faults: list[str]) -> None:
    faults += [f"[cell] {table.name}: row {row}: {words}" for row in table.row[are_faulty].tolist()]
