"""Protocols for fibre outlines and for shapes of table rows, and the base class of all outlines."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields, replace
from typing import NamedTuple, Protocol, Self

import numpy as np

from feti_homog.typing import Bool, Float, Int, Int32

# Directions at the start of the search for the widest gap, then refinements and directions of a refinement.
DIRECTIONS, ZOOMS, ZOOM = 180, 12, 9

# Numbers (N,) of the rows of a table by column; an empty cell has NaN or the default of the column.
Columns = Mapping[str, Float]


class Outlines(Protocol):
    """k closed convex curves c + V + F D: centre c, hull V of a core, frame F and unit disc D."""

    @property
    def centres(self) -> Float:
        """The centres c (k, 2)."""

    @property
    def cores(self) -> Float:
        """The corners of V about the centres, (k, m, 2); the origin for outlines without a core."""

    @property
    def frames(self) -> Float:
        """The frames F (k, 2, 2)."""

    @property
    def radii(self) -> Float:
        """The radii (k,) of equal-area discs."""

    @property
    def longest(self) -> Float:
        """Upper bounds (k,) on the distances between points and centres."""

    @property
    def extents(self) -> Float:
        """The extents (k, 2, 2) from the centre along the two axes, backwards and forwards."""

    def __len__(self) -> int: ...

    def __getitem__(self, rows: Int | Bool) -> Self: ...

    def at(self, centres: Float) -> Self:
        """Move the outlines to other centres (k, 2)."""

    def per(self, unit: float) -> Self:
        """Divide all lengths and centres by a length unit."""

    def rounded(self, decimals: int) -> Self:
        """Round all coordinates to a number of decimals."""

    def grown(self, thickness: Float) -> Self:
        """Enlarge the outlines by rings of thickness (k,)."""

    def joined(self, others: Self) -> Self:
        """Append other outlines."""

    def support(self, normal: Float) -> Float:
        """Evaluate the support functions (k, ...) about the centres at unit vectors n (k, ..., 2)."""

    def parting(self, first: Int, second: Int, vector: Float) -> tuple[Float, Float]:
        """Find the directions that best separate pairs of outlines.

        `vector` v (p, 2) goes from the first centres to the second.  Returns the normals n (p, 2), and the sums r (p,)
        of both supports along n: the gap n . v - r is negative for an overlap.
        """

    def distances(self, offsets: Float) -> Float:
        """Return the distances (n, k) between outlines and points at vectors (n, k, 2) from the centres.

        Distances from outlines that are not round are approximate.
        """


@dataclass(frozen=True)
class ConvexCurves:
    """The common base of all `Outlines`: curves about centres (k, 2)."""

    centres: Float

    def __len__(self) -> int:
        return len(self.centres)

    def __getitem__(self, rows: Int | Int32 | Bool) -> Self:
        return self._each(lambda array: array[rows])

    def at(self, centres: Float) -> Self:
        """Move the curves to other centres (k, 2)."""
        return replace(self, centres=centres)

    def per(self, unit: float) -> Self:
        """Divide all lengths and centres by a length unit."""
        return self._each(lambda array: array / unit)

    def scaled(self, factor: float) -> Self:
        """Multiply all lengths and centres by a factor."""
        return self._each(lambda array: factor * array)

    def rounded(self, decimals: int) -> Self:
        """Round all coordinates to a number of decimals."""
        return self._each(lambda array: array.round(decimals))

    def joined(self, others: Self) -> Self:
        """Append other outlines, whose cores have the same number of corners."""
        return self._each(lambda *arrays: np.concatenate(arrays), others)

    def _each(self, function: Callable[..., Float], *others: Self) -> Self:
        """Apply a function to every field, jointly with the same field of other curves."""
        names = [field.name for field in fields(self)]
        return type(self)(*(function(*(getattr(each, name) for each in (self, *others))) for name in names))


class ColumnRange(NamedTuple):
    """The numbers that a table column allows: value of an empty cell, and bounds."""

    empty: float
    least: float = -np.inf
    above: float = -np.inf


class Shape(Protocol):
    """A shape that table rows may have, other than a disc.

    Attributes:
        name: plural name of the shape, such as "ellipses".
        columns: columns that only this shape needs.
        sizes: columns of the largest lengths, in place of "radius" unless they include it.
        has_tips: whether the mesh of the shape may have nodes at debonded arc tips.
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
        """Yield the faults of rows with this shape: a mask of rows (N,), and a message."""

    def outlines(self, rows: Columns, centres: Float) -> Outlines:
        """Build the outlines of rows (k,) with this shape about centres (k, 2)."""


def directions(angle: Float) -> Float:
    """Return unit vectors (..., 2) at angles in radians."""
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def on_circle(circles: Float, angle: Float) -> Float:
    """Return points (..., 2) on circles (..., 3) of centre and radius, at angles in radians."""
    return np.asarray(circles[..., :2] + circles[..., 2:] * directions(angle))


def widest(vector: Float, gap: Callable[[Float], Float]) -> tuple[Float, Float]:
    """Find the direction of the largest gap between k pairs of curves.

    `vector` (k, 2) goes from the first centres to the second; gap(a) returns the gaps across directions a (k, m).
    Returns the gaps (k,) and directions (k,) in radians.
    """
    step = 2 * np.pi / DIRECTIONS
    around = np.arctan2(vector[:, 1], vector[:, 0])[:, None] + step * np.arange(DIRECTIONS)
    best = around[np.arange(len(vector)), gap(around).argmax(axis=1)]
    for _ in range(ZOOMS):
        around = best[:, None] + np.linspace(-step, step, ZOOM)
        best = around[np.arange(len(vector)), gap(around).argmax(axis=1)]
        step *= 2 / (ZOOM - 1)
    return gap(best[:, None])[:, 0], best
