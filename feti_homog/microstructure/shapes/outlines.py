"""Define the base class of fibre outlines and the ranges of table columns; find the widest gap between curves."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from typing import NamedTuple, Self

import numpy as np

from feti_homog.typing import Bool, Float, Int, Int32

# Search for the widest gap: number of first directions, of refinements, and of directions in a refinement.
DIRECTIONS, ZOOMS, ZOOM = 180, 12, 9

# Numbers (N,) of the rows of a table by column; an empty cell has NaN or the default of the column.
Columns = Mapping[str, Float]


@dataclass(frozen=True)
class ConvexCurves(ABC):
    """The common base of all outlines: k closed convex curves c + V + F D with the unit disc D.

    Derived classes have the methods `grown`, `support` and `distances`, and these fields or properties:

    Attributes:
        centres: (k, 2) centres c.
        cores: (k, m, 2) corners of the hull V about the centres; the origin for outlines without a core.
        frames: (k, 2, 2) frames F.
        radii: (k,) radii of equal-area discs.
        longest: (k,) upper bounds on the distances from the centres to the points of the curves.
    """

    centres: Float

    def __len__(self) -> int:
        return len(self.centres)

    def __getitem__(self, rows: Int | Int32 | Bool) -> Self:
        return self._each(lambda array: array[rows])

    def at(self, centres: Float) -> Self:
        """Return the curves moved to other centres (k, 2)."""
        return replace(self, centres=centres)

    def per(self, unit: float) -> Self:
        """Return the curves with all lengths and centres divided by a length unit."""
        return self._each(lambda array: array / unit)

    def scaled(self, factor: float) -> Self:
        """Return the curves with all lengths and centres multiplied by a factor."""
        return self._each(lambda array: factor * array)

    def rounded(self, decimals: int) -> Self:
        """Return the curves with all coordinates and lengths rounded to a number of decimals."""
        return self._each(lambda array: array.round(decimals))

    def joined(self, others: "ConvexCurves") -> Self:
        """Return these curves followed by `others`.  The cores of all curves must have equally many corners."""
        return self._each(lambda *arrays: np.concatenate(arrays), others)

    @abstractmethod
    def support(self, normal: Float) -> Float:
        """Return the supports max_x n . (x - c) (k, ...) of the curves at unit vectors n (k, ..., 2)."""

    @property
    def extents(self) -> Float:
        """The extents (k, 2, 2) from the centres along both axes, backwards and forwards."""
        axes = np.broadcast_to([[-1.0, 0.0], [1.0, 0.0], [0.0, -1.0], [0.0, 1.0]], (len(self), 4, 2))
        return self.support(axes).reshape(-1, 2, 2)

    def parting(self, first: Int, second: Int, vector: Float) -> tuple[Float, Float]:
        """Find the directions that best separate pairs: maximise v . n - h_1(n) - h_2(-n) for the supports h.

        `vector` v (p, 2) goes from the first centres to the second.  Returns the normals n (p, 2), and the sums r (p,)
        of both supports along n: the gap n . v - r is negative for an overlap.
        """
        one, other = self[first].at(np.zeros_like(vector)), self[second].at(vector)
        normal = directions(gaps(one, other)[1])
        return normal, one.support(normal) + other.support(-normal)

    def _each(self, function: Callable[..., Float], *others: "ConvexCurves") -> Self:
        """Apply a function, field by field, to this object and other curves; return the new curves."""
        curves = (self, *others)
        values = [function(*(getattr(each, field.name) for each in curves)) for field in fields(self)]
        return type(self)(*values)


class ColumnRange(NamedTuple):
    """The numbers in a table column: value of an `empty` cell, inclusive bound `least`, exclusive bound `above`."""

    empty: float
    least: float = -np.inf
    above: float = -np.inf


def directions(angle: Float) -> Float:
    """Return unit vectors (..., 2) at angles in radians."""
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def on_circle(circles: Float, angle: Float) -> Float:
    """Return points (..., 2) on circles (..., 3) of centre and radius, at angles in radians."""
    return np.asarray(circles[..., :2] + circles[..., 2:] * directions(angle))


def gaps(first: ConvexCurves, second: ConvexCurves) -> tuple[Float, Float]:
    """Return the gaps (k,) between pairs of curves, and the gap directions (k,) in radians.

    The gap is max_n (c_2 - c_1) . n - h_1(n) - h_2(-n), h the supports: the distance, or minus the penetration depth.
    """
    vector, step = second.centres - first.centres, 2 * np.pi / DIRECTIONS

    def gap(angle: Float) -> Float:
        n = directions(angle)
        return np.asarray(np.einsum("ki,kmi->km", vector, n) - first.support(n) - second.support(-n))

    around = np.arctan2(vector[:, 1], vector[:, 0])[:, None] + step * np.arange(DIRECTIONS)
    best = around[np.arange(len(vector)), gap(around).argmax(axis=1)]
    for _ in range(ZOOMS):
        around = best[:, None] + np.linspace(-step, step, ZOOM)
        best = around[np.arange(len(vector)), gap(around).argmax(axis=1)]
        step *= 2 / (ZOOM - 1)
    return gap(best[:, None])[:, 0], best
