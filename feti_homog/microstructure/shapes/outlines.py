"""Protocols for fibre outlines and row shapes, and the common base for curves of any shape."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields, replace
from typing import NamedTuple, Protocol, Self

import numpy as np

from feti_homog.typing import Bool, Float, Int, Int32

# Directions in which the distance of two outlines is first looked for, and how often the best are looked between.
DIRECTIONS, ZOOMS, ZOOM = 180, 12, 9

# Numbers (N,) of the rows of a table by column; NaN, or what the column takes for it, where a row has none.
Columns = Mapping[str, Float]


class Outlines(Protocol):
    """k closed convex curves, each a sum c + V + F D of the hull V of a core and the unit disc D in a frame F."""

    @property
    def centres(self) -> Float:
        """(k, 2)"""

    @property
    def cores(self) -> Float:
        """(k, m, 2) corners of V about the centres; the origin where there is no V."""

    @property
    def frames(self) -> Float:
        """(k, 2, 2) F."""

    @property
    def radii(self) -> Float:
        """(k,) radii of equal-area discs."""

    @property
    def longest(self) -> Float:
        """(k,) a bound on the distance of the points from the centres."""

    @property
    def extents(self) -> Float:
        """(k, 2, 2) reach from the centre along each axis, backwards and forwards."""

    def __len__(self) -> int: ...

    def __getitem__(self, rows: Int | Bool) -> Self: ...

    def at(self, centres: Float) -> Self:
        """Return outlines with the same shapes about other centres (k, 2)."""

    def per(self, unit: float) -> Self:
        """Divide all lengths, and the centres, by a unit."""

    def rounded(self, decimals: int) -> Self:
        """Round the coordinates to `decimals`."""

    def grown(self, thickness: Float) -> Self:
        """Return the outlines with rings of this `thickness` (k,) around them."""

    def joined(self, others: Self) -> Self:
        """Return these outlines, then the others."""

    def support(self, normal: Float) -> Float:
        """Return the reach (k, ...) from the centre along unit vectors n (k, ..., 2)."""

    def parting(self, first: Int, second: Int, vector: Float) -> tuple[Float, Float]:
        """Return normals n (p, 2) that best part pairs (p,), and the reach r (p,) along n.

        v (p, 2) are the vectors from first to second; the gap, negative if they overlap, is n . v - r.
        """

    def distances(self, offsets: Float) -> Float:
        """Return distances (n, k) from the outlines to points at vectors (n, k, 2) from centres.

        Approximate unless the outline is round.
        """


@dataclass(frozen=True)
class ConvexCurves:
    """Curves about the centres (k, 2): the common base of all `Outlines`."""

    centres: Float

    def __len__(self) -> int:
        return len(self.centres)

    def __getitem__(self, rows: Int | Int32 | Bool) -> Self:
        return self._each(lambda array: array[rows])

    def at(self, centres: Float) -> Self:
        """See `Outlines`."""
        return replace(self, centres=centres)

    def per(self, unit: float) -> Self:
        """See `Outlines`."""
        return self._each(lambda array: array / unit)

    def scaled(self, factor: float) -> Self:
        """Multiply all lengths by a factor."""
        return self._each(lambda array: factor * array)

    def rounded(self, decimals: int) -> Self:
        """See `Outlines`."""
        return self._each(lambda array: array.round(decimals))

    def joined(self, others: Self) -> Self:
        """See `Outlines`; cores need as many corners."""
        return self._each(lambda *arrays: np.concatenate(arrays), others)

    def _each(self, function: Callable[..., Float], *others: Self) -> Self:
        """Apply a function to each field, or to the same field of several curves together."""
        names = [field.name for field in fields(self)]
        return type(self)(*(function(*(getattr(each, name) for each in (self, *others))) for name in names))


class ColumnRange(NamedTuple):
    """A column of numbers: the value of an empty cell, and the bounds of numbers."""

    empty: float
    least: float = -np.inf
    above: float = -np.inf


class Shape(Protocol):
    """A shape that table rows may have, other than a disc.

    Attributes:
        name: plural name of the shape, as "ellipses".
        columns: columns that other shapes do not need.
        sizes: columns of the largest lengths; without "radius" they replace it.
        has_tips: whether its mesh may have nodes at debonded arc tips.
    """

    @property
    def name(self) -> str: ...

    @property
    def columns(self) -> Mapping[str, ColumnRange]: ...

    @property
    def sizes(self) -> tuple[str, ...]: ...

    @property
    def has_tips(self) -> bool: ...

    def given(self, rows: Columns) -> Bool:
        """Return which rows (N,) have this shape."""

    def faults(self, rows: Columns) -> Iterator[tuple[Bool, str]]:
        """Yield faults of rows that have this shape or seem to: which rows (N,), and the words."""

    def outlines(self, rows: Columns, centres: Float) -> Outlines:
        """Return the outlines for rows (k,) with the shape, about centres (k, 2)."""


def directions(angle: Float) -> Float:
    """Return unit vectors (..., 2) at angles in radians."""
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def on_circle(circles: Float, angle: Float) -> Float:
    """Return points (..., 2) on circles (..., 3) of centre and radius, at angles in radians."""
    return np.asarray(circles[..., :2] + circles[..., 2:] * directions(angle))


def widest(vector: Float, gap: Callable[[Float], Float]) -> tuple[Float, Float]:
    """Return the largest gap (k,) of pairs and its direction (k,) in radians.

    Vectors (k, 2) go from the first to the second; gap(a) are the gaps across directions a (k, m).
    """
    step = 2 * np.pi / DIRECTIONS
    around = np.arctan2(vector[:, 1], vector[:, 0])[:, None] + step * np.arange(DIRECTIONS)
    best = around[np.arange(len(vector)), gap(around).argmax(axis=1)]
    for _ in range(ZOOMS):
        around = best[:, None] + np.linspace(-step, step, ZOOM)
        best = around[np.arange(len(vector)), gap(around).argmax(axis=1)]
        step *= 2 / (ZOOM - 1)
    return gap(best[:, None])[:, 0], best
