"""Compute the edge sizes on the cell lines, smaller on circles and at debond tips."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from feti_homog.case import cell_section
from feti_homog.microstructure import Arrangement, arrangements
from feti_homog.microstructure.shapes import on_circle
from feti_homog.typing import Float

# Largest growth of the edge length per distance.
MAX_GROWTH = 0.4
NEAREST = 16  # sources that count at a position
# Positions in one query of a tree, which limits the memory.
CHUNK = 100_000
# Smallest number of edges around a fibre.
MIN_EDGES_AROUND = 16
# Edge length in a narrow passage, in widths of the passage.
PASSAGE_EDGE = 1.5
# Ratio of the angle between a circle and a crossing side to the turn of the circle along an edge at the crossing.
WEDGE = 3
# Edge size on a circle, relative to the largest, below which elements grow from the circle: gmsh would interpolate
# sizes between tiny discs that are far apart.
FINE_CIRCLE = 0.1
# Outward normals of the sides of a cell.
AXES = np.array([[-1.0, 0.0], [1.0, 0.0], [0.0, -1.0], [0.0, 1.0]])
# Positions (k, 2), edge lengths (k,) and growths (k,).
Source = tuple[Float, Float, Float]


def wrap(points: Float, size: Float) -> Float:
    """Move positions (n, 2) by whole periods into the cell [0, size)."""
    wrapped = points % size
    return np.where(wrapped >= size, 0.0, wrapped)


def circle_size(arrangement: Arrangement, largest: float) -> Float:
    """Return the longest edge (k,), up to `largest`, on each circle of `arrangement.shells`.

    A circle has at least MIN_EDGES_AROUND edges. Edges on a coating of thickness t and inner radius a are at most
    sqrt(t a) long: their arcs rise at most t / 8, and elements across the coating do not turn over when edges bend.
    """
    shells, disc = arrangement.shells
    caps = np.minimum(largest, 2 * np.pi * shells.radii / MIN_EDGES_AROUND)
    return np.asarray(np.minimum(caps, coating_size(arrangement)[disc]))


def coating_size(arrangement: Arrangement) -> Float:
    """Return the longest edges (N,) on coatings: sqrt(t a) for thickness t, disc radius a; infinite for bare discs."""
    return np.where(arrangement.coated, np.sqrt(arrangement.coating * arrangement.radii), np.inf)


def passages(width: Float, curvature: Float, faces: tuple[Float, Float], caps: Sequence[Float | float]) -> list[Source]:
    """Return sources on both faces of passages that need edges shorter than `caps`: positions, lengths, growths.

    The passages have `width` and `curvature` (k,), and points on two `faces` (k, 2); `caps` has a limit for each face,
    () or (k,). The edge length is PASSAGE_EDGE times the width, or less if the edges on the other face are shorter. The
    length grows, but to at most twice the width w + c s^2 / 2 at the distance s along a passage of curvature c.
    """
    growth = np.minimum(MAX_GROWTH, np.sqrt((4 - 2 * PASSAGE_EDGE) * 2 * width * curvature))
    sources = []
    for places, cap, beyond in zip(faces, caps, caps[::-1], strict=True):
        length = np.minimum(PASSAGE_EDGE * width, beyond + MAX_GROWTH * width)
        narrow = length < cap
        sources.append((places[narrow], length[narrow], growth[narrow]))
    return sources


def at_vertices(vertices: Float, size: Float) -> Source:
    """Return distinct `vertices` (v, 2) as sources, with the distance to the next vertex on the torus as length."""
    places = wrap(vertices, size)
    tree = cKDTree(places, boxsize=size)
    same = tree.query_pairs(1e-9 * size.max(), output_type="ndarray")
    places = np.delete(places, same[:, 1], axis=0)
    # The distance from a single vertex is infinite.
    distance, _ = cKDTree(places, boxsize=size).query(places, k=2)
    return places, distance[:, 1], np.full(len(places), MAX_GROWTH)


@dataclass(frozen=True)
class MeshSizes:
    """Largest edge lengths over the cell width: anywhere (`largest`), on circles (`interface`), at tips (`tip`)."""

    largest: float
    interface: float
    tip: float

    @classmethod
    def of(cls, cell: cell_section.Cell, has_tips: bool) -> MeshSizes:
        """Return the sizes in a case; without tips or without `tip_size`, `tip` is `interface`."""
        interface = cell.mesh_size if cell.interface_size is None else cell.interface_size
        return cls(cell.mesh_size, interface, interface if cell.tip_size is None or not has_tips else cell.tip_size)

    def are_graded(self, arrangement: Arrangement) -> bool:
        """Return whether elements on circles or at tips are smaller than elsewhere.

        Thin coatings and tiny discs also need smaller elements.
        """
        return bool(min(self.tip, self.on_circles(arrangement).min()) < self.largest)

    def on_circles(self, arrangement: Arrangement) -> Float:
        """Return the edge sizes (N,) on the circles of N discs; a disc and its coating have one size."""
        sizes = np.minimum(self.interface, coating_size(arrangement))
        around = 2 * np.pi * arrangement.radii / MIN_EDGES_AROUND
        return np.where(around < FINE_CIRCLE * self.largest, np.minimum(sizes, around), sizes)


class SizeField:
    """The size h(x) = min(largest, min_k (h_k + g_k |x - x_k|)) on the torus, or a smaller graded size.

    Source k at x_k has the length h_k and growth g_k; the NEAREST sources within `largest` / MAX_GROWTH of x count.

    Attributes:
        largest: largest size.
        graded: the size that grows with the distance from lines; None without graded elements.
        least: lower bound of the sizes.
    """

    def __init__(self, sources: Sequence[Source], size: Float, largest: float, graded: FromLines | None = None) -> None:
        """Prepare the search for near `sources` on a torus with periods `size` (2,)."""
        self.largest, self.graded, self._size, self._bound = largest, graded, size, largest / MAX_GROWTH
        places, lengths, growths = (np.concatenate(parts) for parts in zip(*sources, strict=True))
        # For missing neighbours, the tree returns the number of sources, an index with infinite length.
        self._lengths, self._growths = np.append(lengths, np.inf), np.append(growths, MAX_GROWTH)
        self.least = min(largest, float(self._lengths.min()), np.inf if graded is None else graded.least)
        self._tree = cKDTree(wrap(places, size), boxsize=size)

    def __call__(self, points: Float) -> Float:
        """Return the sizes (n,) at points (n, 2)."""
        wrapped, count, parts = wrap(points, self._size), min(NEAREST, self._tree.n), []
        for k in range(0, max(1, len(points)), CHUNK):
            some = wrapped[k : k + CHUNK]
            distance, nearest = self._tree.query(some, k=count, distance_upper_bound=self._bound)
            sizes = (self._lengths[nearest] + self._growths[nearest] * distance).reshape(len(some), count)
            parts.append(np.minimum(self.largest, sizes.min(axis=1)))
        sizes = np.concatenate(parts)
        return sizes if self.graded is None else np.asarray(np.minimum(sizes, self.graded(points)))


def size_field(arrangement: Arrangement, sizes: MeshSizes, vertices: Float, tips: Float) -> SizeField:
    """Return the field of edge sizes on the torus, from passages, vertices, discs and tips.

    The sources (x_k, h_k) are the faces of narrow passages between two fibres, or between a fibre and a side or corner
    of the cell, with h_k proportional to the passage width; crossings of circles of radius R and sides at an angle phi,
    with h_k = R phi / WEDGE; and the mandatory `vertices` (v, 2), with the distance to the next vertex as h_k. Graded
    sizes are at most h_i + g d_i at the distance d_i from disc i, with h_i from `MeshSizes.on_circles`, and
    h_t + g max(0, d_t - h_t) at the distance d_t from one of the `tips` (t, 2), where edges have the size h_t; g is
    MAX_GROWTH.
    """
    size, largest, (shells, disc) = arrangement.size, sizes.largest, arrangement.shells
    circles, caps = np.column_stack([shells.centres, shells.radii]), circle_size(arrangement, largest)
    # Between fibres.
    is_outer = np.diff(disc, prepend=-1) > 0
    outer, longest = circles[is_outer], caps[is_outer]
    first, second, vector = arrangements.neighbours(outer[:, :2], size, 2 * outer[:, 2].max() + largest)
    distance, one, other = np.linalg.norm(vector, axis=1), outer[first], outer[second]
    gap, normal = distance - one[:, 2] - other[:, 2], vector / distance[:, None]
    faces = one[:, :2] + one[:, 2:] * normal, other[:, :2] - other[:, 2:] * normal
    sources = passages(gap, 1 / one[:, 2] + 1 / other[:, 2], faces, (longest[first], longest[second]))
    # Between circles and sides, and at crossings.
    centres, radii = circles[:, :2] % size, circles[:, 2]
    for axis in AXES:
        distance = np.where(axis > 0, size - centres, centres) @ np.abs(axis)
        extreme, foot = centres + radii[:, None] * axis, centres + distance[:, None] * axis
        sources += passages(np.abs(distance - radii), 1 / radii, (extreme, foot), (caps, largest))
        angle = np.arccos(np.minimum(distance / radii, 1.0))
        length = angle * radii / WEDGE
        sharp = (length < caps) & (angle > 0)
        half = (radii * np.sin(angle))[sharp, None] * np.abs(axis[::-1])
        for crossing in (foot[sharp] - half, foot[sharp] + half):
            sources.append((crossing, length[sharp], np.full(len(crossing), MAX_GROWTH)))
    # At circles near the corner: the corner and the nearest point on the circle.
    offset = (circles[:, :2] + size / 2) % size - size / 2
    distance = np.linalg.norm(offset, axis=1)
    to_corner = PASSAGE_EDGE * np.abs(distance - circles[:, 2])
    close = to_corner < caps
    facing = offset[close] * (1 - circles[close, 2] / distance[close])[:, None]
    corners = np.concatenate([facing, np.zeros_like(facing)])
    sources += [(corners, np.tile(to_corner[close], 2), np.full(len(corners), MAX_GROWTH)), at_vertices(vertices, size)]
    if not sizes.are_graded(arrangement):
        return SizeField(sources, size, largest)
    # Points on the outer circles, h_i apart, to find the nearest disc.
    lengths = sizes.on_circles(arrangement)
    counts = np.ceil(2 * np.pi * outer[:, 2] / lengths).astype(int)
    disc = np.repeat(np.arange(len(counts)), counts)
    angle = 2 * np.pi * (np.arange(len(disc)) - np.repeat(np.cumsum(counts) - counts, counts)) / counts[disc]
    lines = FromLines(size, on_circle(outer[disc], angle), lengths[disc], sizes.tip, tips, outer[disc])
    return SizeField(sources, size, largest, lines)


class FromLines:
    """Sizes min(h_i + g d_i, h_t + g max(0, d_t - h_t)) that grow from lines and tips, with g = MAX_GROWTH.

    d_i and d_t are the distances to the nearest line and to the nearest tip, h_i and h_t the edge lengths on this line
    and at tips. `least` is a lower bound of the sizes.
    """

    def __init__(
        self, size: Float, points: Float, lengths: Float, tip: float, tips: Float, circles: Float | None = None
    ) -> None:
        """Prepare `points` (s, 2) on lines with lengths h_i (s,), and `tips` (t, 2) with the length h_t = `tip`.

        The distance d_i refers to the circles (s, 3) through the points or, without circles, to the points.
        """
        self._size, self._lengths, self._tip, self._circles = size, lengths, tip, circles
        self._points, self._tips = (cKDTree(wrap(x.reshape(-1, 2), size), boxsize=size) for x in (points, tips))
        self.least = min(tip, float(lengths.min()))

    def __call__(self, points: Float) -> Float:
        """Return the sizes (n,) at positions (n, 2) on the torus."""
        places = wrap(points, self._size)
        distance, nearest = self._points.query(places)
        if self._circles is not None:
            circles = self._circles[nearest]
            offset = (points - circles[:, :2] + self._size / 2) % self._size - self._size / 2
            distance = np.abs(np.linalg.norm(offset, axis=1) - circles[:, 2])
        # Without tips, the distance is infinite.
        at_tips = self._tip + MAX_GROWTH * np.maximum(0.0, self._tips.query(places)[0] - self._tip)
        return np.asarray(np.minimum(self._lengths[nearest] + MAX_GROWTH * distance, at_tips))
