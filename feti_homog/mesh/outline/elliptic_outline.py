"""Build the arcs of ellipses, and the edge sizes of cells with ellipses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from feti_homog.mesh.outline import graded_size
from feti_homog.mesh.outline.lines import Lines
from feti_homog.mesh.outline.outline import TURN
from feti_homog.microstructure import Arrangement, arrangements
from feti_homog.microstructure.shapes import Ellipses, convex_sums, directions, gaps
from feti_homog.typing import Float, Int

# Longest edge on a coating, in thicknesses.
LONGEST = 10.0


@dataclass(frozen=True)
class EllipticArcs(Lines):
    """Arcs of ellipses, with lengths along chords between samples.

    Attributes:
        ellipses: (a,) the ellipse of each arc.
        angle, way: (a, k) parameters of k samples on each arc, and arc lengths from the start to the samples.
    """

    ellipses: Ellipses
    angle: Float
    way: Float
    cap: Float

    @classmethod
    def of(cls, ellipses: Ellipses, start: Float, stop: Float, cap: float) -> EllipticArcs:
        """Return the arcs of `ellipses` (a,) from parameters `start` (a,) to `stop` (a,), with the limit `cap`."""
        share = np.linspace(0, 1, convex_sums.POINTS + 1)
        angle = start[:, None] + (stop - start)[:, None] * share
        places = np.stack([ellipses.points(angle[:, k]) for k in range(len(share))], axis=1)
        length = np.cumsum(np.linalg.norm(np.diff(places, axis=1), axis=2), axis=1)
        return cls(ellipses, angle, np.column_stack([np.zeros(len(length)), length]), np.full((len(length), 2), cap))

    @property
    def lengths(self) -> Float:
        """The length (a,) of each arc."""
        return self.way[:, -1]

    def points(self, line: Int, share: Float) -> Float:
        """Return the points (n, 2) at the fractions `share` (n,) of the arcs `line` (n,)."""
        way = self.way / self.way[:, -1:]
        after = np.clip((way[line] <= share[:, None]).sum(axis=1), 1, convex_sums.POINTS)
        low, high = way[line, after - 1], way[line, after]
        part = (share - low) / (high - low)
        parameter = self.angle[line, after - 1] * (1 - part) + self.angle[line, after] * part
        return self.ellipses[line].points(parameter)


def size_field(
    arrangement: Arrangement,
    sizes: graded_size.MeshSizes,
    vertices: Float,
    tips: Float,
    crossed: Ellipses,
    crossings: Float,
) -> graded_size.SizeField:
    """Return the size field of a cell with ellipses; see `graded_size.size_field`.

    Cell sides meet the ellipses `crossed` (c,) at `crossings` (c, 2), where edges are at most R phi / WEDGE long, with
    the angle phi between side and ellipse, and the radius of curvature R of the ellipse.
    """
    size, largest, inner = arrangement.size, sizes.largest, arrangement.outlines
    assert isinstance(inner, Ellipses)
    shells, disc = arrangement.shells
    # Ellipses in meshing order make the mesh independent of the row order.
    order = np.argsort(np.argsort(arrangement.order)[disc], kind="stable")
    ellipses, disc = Ellipses(shells.centres, shells.frames)[order], disc[order]
    angle = np.tile(np.linspace(0, 2 * np.pi, convex_sums.POINTS, endpoint=False), len(ellipses))
    around = np.repeat(np.arange(len(ellipses)), convex_sums.POINTS)
    points, normal = ellipses[around].points(angle), ellipses[around].normal(angle)
    # Edges on both sides of coatings: as on circles, sqrt(t R), with the local thickness and radius of curvature, but
    # not longer than in the thinnest coatings around circles.
    within, coating = inner[disc[around]], arrangement.coating[disc[around]]
    thickness = within.grown(coating).support(normal) - within.support(normal)
    thin = np.minimum(np.sqrt(thickness * within.bend(normal)), LONGEST * thickness)
    lengths = np.minimum(sizes.interface, np.where(coating > 0, thin, np.inf))
    # As on circles of the same curvature.
    caps = np.minimum(2 * np.pi * ellipses[around].bend(normal) / graded_size.MIN_EDGES_AROUND, lengths)
    normal = crossed.normal(crossed.parameter(crossings - crossed.centres) % TURN)
    along = np.where(np.isin(crossings[:, 0], (0.0, size[0])), normal[:, 0], normal[:, 1])
    sharp = crossed.bend(normal) * np.arccos(np.minimum(np.abs(along), 1.0)) / graded_size.WEDGE
    offset = (points + size / 2) % size - size / 2
    nearest = offset[np.argmin(np.linalg.norm(offset, axis=1))]
    to_corner = min(graded_size.PASSAGE_EDGE * float(np.linalg.norm(nearest)), largest)
    # Between fibres.
    outer = ellipses[np.diff(disc, prepend=-1) != 0]
    first, second, vector = arrangements.neighbours(outer.centres, size, 2 * outer.longest.max() + largest)
    one, other = outer[first], outer[second].at(outer.centres[first] + vector)
    gap, direction = gaps(one, other)
    normal = directions(direction)
    curvature, faces = 1 / one.bend(normal) + 1 / other.bend(-normal), (one.facing(normal), other.facing(-normal))
    sources = [(points, caps, np.full(len(points), graded_size.MAX_GROWTH))]
    sources += graded_size.passages(gap, curvature, faces, (largest, largest))
    # Between ellipses and sides.
    for axis in graded_size.AXES:
        normal = np.tile(axis, (len(ellipses), 1))
        extreme = ellipses.facing(normal)
        foot = np.where(normal == 0, extreme, np.round(extreme / size) * size)
        width = np.abs(extreme - foot).max(axis=1)
        sources += graded_size.passages(width, 1 / ellipses.bend(normal), (extreme, foot), (largest, largest))
    sources += [
        (crossings, np.minimum(sharp, largest), np.full(len(crossings), graded_size.MAX_GROWTH)),
        (np.stack([nearest, np.zeros(2)]), np.full(2, to_corner), np.full(2, graded_size.MAX_GROWTH)),
        graded_size.at_vertices(vertices, size),
    ]
    is_graded = sizes.are_graded(arrangement)
    lines = graded_size.FromLines(size, points, lengths, sizes.tip, tips) if is_graded else None
    return graded_size.SizeField(sources, size, largest, lines)
