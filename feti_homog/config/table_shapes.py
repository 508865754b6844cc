"""Round and elliptic fibres of a table: every fibre gets a radius and semi-axes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from feti_homog.config.fibre_table import FibreTable
from feti_homog.typing import Bool, Float

# Shorter / longer semi-axis of a fibre, at least: elements at the tips would be too small.
THINNEST = 0.05


def with_shapes(table: FibreTable, faults: list[str]) -> FibreTable:
    """The table whose radii sqrt(a b) are those of discs of the same area, and whose discs have semi-axes too.

    Semi-axes are None if all fibres are round. Faults are added to `faults`.
    """
    if table.a is None or table.b is None:
        return replace(table, a=None, b=None, angle=None)
    given = ~np.isnan(table.a)
    a, b = np.where(given, table.a, table.radius), np.where(given, table.b, table.radius)
    angle = np.zeros(len(a)) if table.angle is None else table.angle
    _tell(table, given & ~np.isnan(table.radius), "has a radius and semi-axes; give one", faults)
    thin = np.minimum(a, b) < THINNEST * np.maximum(a, b)
    _tell(table, thin, f"expected a / b from {THINNEST:g} to {1 / THINNEST:g}", faults)
    is_oval = a != b
    if not is_oval.any():
        return replace(table, radius=a, a=None, b=None, angle=None)
    radius: Float = np.where(is_oval, np.sqrt(a * b), a)
    return replace(table, radius=radius, a=a, b=b, angle=np.where(is_oval, angle, 0.0))


def _tell(table: FibreTable, are_faulty: Bool, words: str, faults: list[str]) -> None:
    faults += [f"[cell] {table.name}: row {row}: {words}" for row in table.row[are_faulty].tolist()]
