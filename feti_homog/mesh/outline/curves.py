"""The lines of a cell as arrays: pieces of sides, arcs and bridges with the nodes on them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from feti_homog.system.parallel.dividing import ranges
from feti_homog.typing import Bool, Float, Int

# Regions: what is beside a curve where that is no disc or coating.
MATRIX, OUTSIDE = -1, -2


@dataclass(frozen=True)
class Curve:
    """A piece of a side or a circle from vertex to vertex, counter-clockwise around the cell or the disc, or a bridge.

    Attributes:
        nodes: (k,) numbers of its nodes, from end to end.
        circle: the circle it lies on; MATRIX for a straight line.
        inside: what is on its left: the disc, or the coating, within that circle, or MATRIX, or OUTSIDE.
        outside: what is on its right: the coating within the circle around it, or MATRIX, or OUTSIDE.
    """

    nodes: Int
    circle: int
    inside: int
    outside: int


@dataclass(frozen=True)
class Curves:
    """c curves; curve k has the nodes node[first[k] : first[k + 1]], and the other arrays (c,) are as in `Curve`."""

    node: Int
    first: Int
    circle: Int
    inside: Int
    outside: Int

    def __len__(self) -> int:
        return len(self.circle)

    @property
    def ends(self) -> Int:
        """(c, 2) first and last node of each."""
        return np.stack([self.node[self.first[:-1]], self.node[self.first[1:] - 1]], axis=1)

    def pieces(self) -> list[Curve]:
        """One after the other."""
        nodes = np.split(self.node, self.first[1:-1])
        beside = (self.circle.tolist(), self.inside.tolist(), self.outside.tolist())
        return [Curve(*parts) for parts in zip(nodes, *beside, strict=True)]

    def chosen(self, those: Int) -> Curves:
        """Return the curves `those` (k,)."""
        node, first = rows_of(self.first, those)
        return Curves(self.node[node], first, self.circle[those], self.inside[those], self.outside[those])

    @classmethod
    def joined(cls, parts: Sequence[Curves]) -> Curves:
        """All of these, one after the other."""
        counts = np.concatenate([np.diff(part.first) for part in parts])
        return cls(
            np.concatenate([part.node for part in parts]),
            np.concatenate([[0], np.cumsum(counts)]),
            *(np.concatenate([getattr(part, name) for part in parts]) for name in ("circle", "inside", "outside")),
        )


def rows_of(first: Int, those: Int) -> tuple[Int, Int]:
    """Return where the rows of the groups `those` (k,) are, and where each of these groups begins among them.

    Group i has the rows from first[i] up to first[i + 1].
    """
    counts = first[those + 1] - first[those]
    return ranges(first[those], counts), np.concatenate([[0], np.cumsum(counts)])


def backwards(node: Int, first: Int, turned: Bool) -> Int:
    """Return the nodes of the curves with those of the curves `turned` (c,) in reverse."""
    counts = np.diff(first)
    place = np.arange(len(node))
    mirror = np.repeat(first[:-1] + first[1:] - 1, counts) - place
    return np.asarray(node[np.where(np.repeat(turned, counts), mirror, place)])


class Numbering:
    """Gives numbers to the nodes: first the vertices (v, 2), found by position, then those between."""

    def __init__(self, vertices: Float) -> None:
        self.vertices = vertices
        self._tree = cKDTree(vertices)
        self._between: list[Float] = []
        self._count = len(vertices)

    def along(self, points: Float, first: Int) -> Int:
        """Numbers (n,) of the nodes at `points` (n, 2) of curves.

        Which begin at first[:-1] and whose ends are vertices.
        """
        is_end = np.zeros(len(points), bool)
        is_end[first[:-1]] = is_end[first[1:] - 1] = True
        number = np.empty(len(points), np.int64)
        number[is_end] = self._tree.query(points[is_end])[1]
        between = np.count_nonzero(~is_end)
        number[~is_end] = np.arange(self._count, self._count + between)
        self._count += between
        self._between.append(points[~is_end])
        return number

    def points(self) -> Float:
        """Positions (n, 2) of all nodes by number."""
        return np.concatenate([self.vertices, *self._between])
