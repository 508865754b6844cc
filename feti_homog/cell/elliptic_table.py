"""Ellipses of a table on the torus: which overlap or touch, and where the cell's sides pass between them."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from feti_homog.cell.ellipses import Ellipses, gaps
from feti_homog.cell.torus_pairs import neighbours
from feti_homog.typing import Float, Int

if TYPE_CHECKING:
    from feti_homog.cell.arrangement import Arrangement
    from feti_homog.config.fibre_table import FibreTable


def ellipses_of(table: FibreTable, rows: Int, centres: Float) -> Ellipses:
    """Those of the rows (k,) of a table with semi-axes, about centres (k, 2), in the table's unit."""
    assert table.a is not None and table.b is not None and table.angle is not None
    return Ellipses.of(centres, table.a[rows], table.b[rows], table.angle[rows])


def contacts(table: FibreTable, rows: Int, centres: Float, size: Float, least: float) -> list[str]:
    """Faults of the rows (k,) about centres (k, 2) that overlap, or whose gap / mean radius is below `least`."""
    ellipses = ellipses_of(table, rows, centres)
    first, second, vector = neighbours(centres, size, 2 * ellipses.longest.max() * (1 + least))
    other = Ellipses(centres[first] + vector, ellipses.frames[second])
    gap, _ = gaps(ellipses[first], other)
    near = least * (table.radius[rows[first]] + table.radius[rows[second]]) / 2
    bad = np.flatnonzero(gap < near)
    faults = []
    for k in bad[np.unique(np.stack([first[bad], second[bad]]), axis=1, return_index=True)[1]].tolist():
        i, j = table.row[rows[first[k]]], table.row[rows[second[k]]]
        who = f"rows {i} and {j}" if i != j else f"row {i} and its image"
        is_across = np.abs(centres[second[k]] - centres[first[k]] - vector[k]).max() > size.max() / 4
        what = f"overlap by {-gap[k]:.3g}" if gap[k] < -near[k] else "touch"
        faults.append(f"{who}: {what}{' across the border' if is_across else ''}")
    return faults


def clearance(arrangement: Arrangement) -> float:
    """Distance of the sides of the cell from the nearest position at which they would touch an ellipse."""
    size = np.array([arrangement.width, arrangement.height])
    reach = arrangement.ellipses.reach[:, None] * np.array([1, -1])[:, None]
    touching = (arrangement.centres[:, None] + reach) / size
    return float(np.abs((touching - np.round(touching)) * arrangement.width).min())


def clear_shift(arrangement: Arrangement) -> Arrangement:
    """The arrangement moved as a whole such that the cell's boundary stays clear of tangency with the ellipses.

    As of discs: the sides are in the middles of the widest gaps between tangents, the corner far from ellipses.
    """
    size, reach = np.array([arrangement.width, arrangement.height]), arrangement.ellipses.reach
    lines = []
    for axis in (0, 1):
        centre = arrangement.centres[:, axis]
        touching = np.sort(np.concatenate([centre - reach[:, axis], centre + reach[:, axis]]) % size[axis])
        widths = np.diff(touching, append=touching[0] + size[axis])
        wide = np.argsort(-widths, kind="stable")[:4]
        wide = wide[widths[wide] > 0.7 * widths[wide[0]]]
        lines.append(touching[wide] + widths[wide] / 2)
    corners = np.array(list(product(*lines)))
    offset = (corners[:, None] - arrangement.centres + size / 2) % size - size / 2
    unit = np.einsum("kij,nkj->nki", np.linalg.inv(arrangement.ellipses.frames), offset)
    away = np.abs(np.linalg.norm(unit, axis=2) - 1) * arrangement.radii
    corner = corners[np.argmax(away.min(axis=1))]
    return replace(arrangement, centres=(arrangement.centres - corner) % size)
