"""Rounded polygons."""

from __future__ import annotations

from collections.abc import Iterator
from types import MappingProxyType

import numpy as np

from feti_homog.fibres.outlines.convex_sums import ConvexSums
from feti_homog.fibres.outlines.outlines import Column, Columns, directions
from feti_homog.typing import Bool, Float

# The fewest and the most sides.
SIDES = 3, 12


class PolygonalRows:
    """Rows with `sides`, as `Shape`.

    Regular polygons of that circumradius, the first corner at `angle`, rounded by circles that touch both sides at a
    corner; `corner` is their radius / that of the circle within the sides.
    """

    name, sizes, has_tips = "polygons", ("radius",), False
    columns = MappingProxyType({"sides": Column(0.0, least=0.0), "corner": Column(0.0, least=0.0)})

    def given(self, rows: Columns) -> Bool:
        """(N,) which rows have it."""
        return np.asarray(rows["sides"] != 0)

    def faults(self, rows: Columns) -> Iterator[tuple[Bool, str]]:
        """See `Shape`."""
        (least, most), sides, corner, given = SIDES, rows["sides"], rows["corner"], self.given(rows)
        are_odd = given & ((sides != np.round(sides)) | (sides < least) | (sides > most))
        yield are_odd, f"expected sides from {least} to {most}, a whole number, or 0"
        yield given & (corner > 1), "expected corner at most 1, which makes a circle"
        yield ~given & (corner > 0), "has a corner, but no sides"
        for name in ("a", "coating", "inner_radius"):
            yield given & (np.nan_to_num(rows[name]) > 0), f"has sides and {name}; give one"

    def outlines(self, rows: Columns, centres: Float) -> ConvexSums:
        """See `Shape`."""
        sides, radius = np.maximum(rows["sides"].astype(np.intp), SIDES[0]), rows["radius"]
        rounding = rows["corner"] * radius * np.cos(np.pi / sides)
        # Corners of the polygon of the centres of the rounding circles.
        core = radius - rounding / np.cos(np.pi / sides)
        corner = np.minimum(np.arange(sides.max()), sides[:, None] - 1)
        turn = np.radians(rows["angle"])[:, None] + 2 * np.pi * corner / sides[:, None]
        return ConvexSums(centres, core[:, None, None] * directions(turn), rounding[:, None, None] * np.eye(2))
