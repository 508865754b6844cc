"""Meshes that are finer on circles, and at the tips of debonded arcs, than elsewhere."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from feti_homog.fibres.arrangement import Arrangement
from feti_homog.mesh.lines import on_circles
from feti_homog.mesh.sizes.from_sources import MAX_GROWTH, SourcedSize, wrap
from feti_homog.mesh.sizes.size_field import MIN_EDGES_AROUND, coating_size, line_size
from feti_homog.typing import Float, Int

# Samples of a size on a line for each of its edges, where the size is graded.
SAMPLES_OF_AN_EDGE = 3
# Size of edges on a circle / largest size, below which elements grow from it: between tiny discs far apart, gmsh would
# interpolate the sizes on their circles.
FINE_CIRCLE = 0.1


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
        """Whether the mesh is finer on circles or at tips than elsewhere, as it is on thin coatings and tiny discs."""
        return bool(min(self.tip, self.on_circles(arrangement).min()) < self.largest)

    def on_circles(self, arrangement: Arrangement) -> Float:
        """(N,) on the circles of each disc."""
        sizes = np.where(arrangement.coated, np.minimum(self.interface, coating_size(arrangement)), self.interface)
        around = 2 * np.pi * arrangement.radii / MIN_EDGES_AROUND
        return np.where(around < FINE_CIRCLE * self.largest, np.minimum(sizes, around), sizes)


@dataclass(frozen=True)
class SizeField:
    """The size of edges on the lines of a cell: the smaller of two sizes, of which the second grows along lines."""

    base: SourcedSize
    graded: Callable[[Float], Float] | None = None

    @property
    def step(self) -> float:
        """Distance of positions on a line between which it may be interpolated / size."""
        return np.inf if self.graded is None else 1 / SAMPLES_OF_AN_EDGE

    def at(self, points: Float) -> Float:
        """Sizes (n,) at positions (n, 2)."""
        sizes = self.base(points)
        return sizes if self.graded is None else np.minimum(sizes, self.graded(points))

    def on_lines(self, points: Float) -> Float:
        """Sizes (c, m) at positions (c, m, 2) along c lines: the same."""
        sizes = self.base.on_lines(points)
        if self.graded is None:
            return sizes
        return np.minimum(sizes, self.graded(points.reshape(-1, 2)).reshape(points.shape[:2]))


def size_field(arrangement: Arrangement, sizes: MeshSizes, vertices: Float, tips: Float) -> SizeField:
    """`line_size`, but at most h_i + g d at the distance d from a disc, and h_t + g max(0, d - h_t) from one of the
    `tips` (t, 2), so that the edges at a tip have the size h_t; the growth g is MAX_GROWTH."""
    base = line_size(arrangement, sizes.largest, vertices)
    if not sizes.are_graded(arrangement):
        return SizeField(base)
    return SizeField(base, _FromLines.of(arrangement, sizes, tips))


@dataclass(frozen=True)
class _FromLines:
    """h_i + g d and h_t + g max(0, d - h_t) as in `size_field`, whichever is smaller.

    Which disc is the nearest, points h_i apart on the circles tell.

    Attributes:
        size: (2,) of the cell.
        circles: (N, 3) the outer circle of each disc.
        caps: (N,) h_i.
        tip: h_t.
        near_tips: tree of the tips.
        spokes, disc: tree of the points on circles, and their discs (s,).
    """

    size: Float
    circles: Float
    caps: Float
    tip: float
    near_tips: cKDTree
    spokes: cKDTree
    disc: Int

    @classmethod
    def of(cls, arrangement: Arrangement, sizes: MeshSizes, tips: Float) -> _FromLines:
        """That of a cell."""
        size, caps = arrangement.size, sizes.on_circles(arrangement)
        radii = arrangement.outer_radii
        counts = np.ceil(2 * np.pi * radii / caps).astype(int)
        disc = np.repeat(np.arange(len(counts)), counts)
        angle = 2 * np.pi * (np.arange(len(disc)) - np.repeat(np.cumsum(counts) - counts, counts)) / counts[disc]
        circles = np.column_stack([arrangement.centres, radii])
        spokes = cKDTree(wrap(on_circles(circles, disc, angle), size), boxsize=size)
        near_tips = cKDTree(wrap(tips.reshape(-1, 2), size), boxsize=size)
        return cls(size, circles, caps, sizes.tip, near_tips, spokes, disc)

    def __call__(self, points: Float) -> Float:
        """(n,) at positions (n, 2) on the torus."""
        places = wrap(points, self.size)
        nearest = self.disc[self.spokes.query(places)[1]]
        offset = (points - self.circles[nearest, :2] + self.size / 2) % self.size - self.size / 2
        away = np.abs(np.linalg.norm(offset, axis=1) - self.circles[nearest, 2])
        # Without tips the distance is infinite.
        at_tips = self.tip + MAX_GROWTH * np.maximum(0.0, self.near_tips.query(places)[0] - self.tip)
        return np.asarray(np.minimum(self.caps[nearest] + MAX_GROWTH * away, at_tips))
