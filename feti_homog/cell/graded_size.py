"""Meshes that are finer on circles, and at the tips of debonded arcs, than elsewhere."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from feti_homog.cell.arrangement import Arrangement
from feti_homog.cell.size_field import coating_size, line_size
from feti_homog.cell.sourced_size import MAX_GROWTH, SourcedSize, wrap
from feti_homog.typing import Float

# Samples of a size on a line for each of its edges, where the size is graded.
SAMPLES_OF_AN_EDGE = 3


@dataclass(frozen=True)
class MeshSizes:
    """Edge lengths that a mesh is asked for, at most; each no larger than the one before.

    Attributes:
        largest: anywhere.
        interface: on the circles.
        tip: at the tips of debonded arcs.
    """

    largest: float
    interface: float
    tip: float

    @classmethod
    def uniform(cls, largest: float) -> MeshSizes:
        """One size for all."""
        return cls(largest, largest, largest)

    def are_graded(self, arrangement: Arrangement) -> bool:
        """Whether the mesh is finer on circles or at tips than elsewhere, as it is on thin coatings."""
        return bool(min(self.tip, self.on_circles(arrangement).min()) < self.largest)

    def on_circles(self, arrangement: Arrangement) -> Float:
        """(N,) on the circles of each disc."""
        return np.where(arrangement.coated, np.minimum(self.interface, coating_size(arrangement)), self.interface)


@dataclass(frozen=True)
class SizeField:
    """The size of edges on the lines of a cell.

    Attributes:
        at: sizes (n,) at positions (n, 2).
        on_lines: sizes (c, m) at positions (c, m, 2) along c lines: the same.
        step: distance of positions on a line between which it may be interpolated / size.
    """

    at: Callable[[Float], Float]
    on_lines: Callable[[Float], Float]
    step: float = np.inf

    @classmethod
    def least(cls, base: SourcedSize, graded: Callable[[Float], Float]) -> SizeField:
        """The smaller of two sizes, of which the second grows along lines."""
        return cls(
            lambda points: np.asarray(np.minimum(base(points), graded(points))),
            lambda points: np.asarray(
                np.minimum(base.on_lines(points), graded(points.reshape(-1, 2)).reshape(points.shape[:2]))
            ),
            1 / SAMPLES_OF_AN_EDGE,
        )


def size_field(arrangement: Arrangement, sizes: MeshSizes, vertices: Float, tips: Float) -> SizeField:
    """`line_size`, but at most h_i + g d at the distance d from a disc, and h_t + g max(0, d - h_t) from one of the
    `tips` (t, 2), so that the edges at a tip have the size h_t; the growth g is MAX_GROWTH."""
    base = line_size(arrangement, sizes.largest, vertices)
    if not sizes.are_graded(arrangement):
        return SizeField(base, base.on_lines)
    size = np.array([arrangement.width, arrangement.height])
    on_circles = _from_circles(arrangement, size, sizes.on_circles(arrangement))
    tree = cKDTree(wrap(tips.reshape(-1, 2), size), boxsize=size)

    def graded(points: Float) -> Float:
        # Without tips the distance is infinite.
        at_tips = sizes.tip + MAX_GROWTH * np.maximum(0.0, tree.query(wrap(points, size))[0] - sizes.tip)
        return np.asarray(np.minimum(on_circles(points), at_tips))

    return SizeField.least(base, graded)


def _from_circles(arrangement: Arrangement, size: Float, caps: Float) -> Callable[[Float], Float]:
    """The function h_i + g d (n,) of positions (n, 2) on the torus, d the distance from the nearest outer circle and
    h_i the one of `caps` (N,) of its disc. Which that is, points h_i apart on the circles tell."""
    radii = arrangement.outer_radii
    counts = np.ceil(2 * np.pi * radii / caps).astype(int)
    circle = np.repeat(np.arange(len(counts)), counts)
    angle = 2 * np.pi * (np.arange(len(circle)) - np.repeat(np.cumsum(counts) - counts, counts)) / counts[circle]
    spokes = radii[circle, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    tree = cKDTree(wrap(arrangement.centres[circle] + spokes, size), boxsize=size)

    def at(points: Float) -> Float:
        nearest = circle[tree.query(wrap(points, size))[1]]
        offset = (points - arrangement.centres[nearest] + size / 2) % size - size / 2
        return np.asarray(caps[nearest] + MAX_GROWTH * np.abs(np.linalg.norm(offset, axis=1) - radii[nearest]))

    return at
