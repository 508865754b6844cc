"""Ellipses of a table on the torus: with their coatings, and where the cell's sides pass between them."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from feti_homog.fibres.clear_sides import farthest, widest_gaps
from feti_homog.fibres.ellipses import Ellipses
from feti_homog.typing import Float, Int

if TYPE_CHECKING:
    from feti_homog.case.fibre_table import FibreTable
    from feti_homog.fibres.arrangement import Arrangement


def ellipses_of(table: FibreTable, rows: Int, centres: Float) -> Ellipses:
    """Those of the rows (k,) of a table with semi-axes, about centres (k, 2), in the table's unit."""
    assert table.a is not None and table.b is not None and table.angle is not None
    return Ellipses.of(centres, table.a[rows], table.b[rows], table.angle[rows])


def with_coatings(table: FibreTable, rows: Int, centres: Float) -> Ellipses:
    """Those with the coatings of the thickness t around them, of semi-axes a + t and b + t."""
    own = ellipses_of(table, rows, centres)
    return own if table.coating is None else own.grown((table.coating * table.radius)[rows])


def shells(arrangement: Arrangement) -> tuple[Ellipses, Int]:
    """All ellipses of an arrangement, and their discs (k,): for each the outer one, then that within a coating."""
    own, coated = arrangement.ellipses, arrangement.coated
    disc = np.concatenate([np.arange(len(own)), np.flatnonzero(coated)])
    order = np.argsort(disc, kind="stable")
    return own.grown(arrangement.thickness).joined(own[coated])[order], disc[order]


def clearance(arrangement: Arrangement) -> float:
    """Distance of the sides of the cell from the nearest position at which they would touch an ellipse."""
    size = np.array([arrangement.width, arrangement.height])
    ellipses, _ = shells(arrangement)
    reach = ellipses.reach[:, None] * np.array([1, -1])[:, None]
    touching = (ellipses.centres[:, None] + reach) / size
    return float(np.abs((touching - np.round(touching)) * arrangement.width).min())


def clear_shift(arrangement: Arrangement) -> Arrangement:
    """The arrangement moved as a whole such that the cell's boundary stays clear of tangency with the ellipses.

    As of discs: the sides are in the middles of the widest gaps between tangents, the corner far from ellipses.
    """
    size, (ellipses, disc) = np.array([arrangement.width, arrangement.height]), shells(arrangement)
    reach, lines = ellipses.reach, []
    for axis in (0, 1):
        centre = ellipses.centres[:, axis]
        touching = np.concatenate([centre - reach[:, axis], centre + reach[:, axis]])
        lines.append(widest_gaps(touching, size[axis]))
    corners = np.array(list(product(*lines)))
    offset = (corners[:, None] - ellipses.centres + size / 2) % size - size / 2
    unit = np.einsum("kij,nkj->nki", np.linalg.inv(ellipses.frames), offset)
    away = np.abs(np.linalg.norm(unit, axis=2) - 1) * arrangement.radii[disc]
    return replace(arrangement, centres=(arrangement.centres - farthest(corners, away.min(axis=1))) % size)
