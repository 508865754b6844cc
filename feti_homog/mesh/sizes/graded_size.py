"""Edge sizes on the cell's lines, smaller on circles and at debond tips."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from feti_homog.case import cell_section
from feti_homog.microstructure import Arrangement, arrangements
from feti_homog.microstructure.shapes import on_circle
from feti_homog.typing import Float, Int

# Growth of the edge length per distance, at most.
MAX_GROWTH = 0.4
NEAREST = 16  # sources that count at a position
# Positions in one query of a tree, which bounds its memory.
CHUNK = 100_000
# Edges around a fibre, at least.
MIN_EDGES_AROUND = 16
# Edge length in a narrow passage, relative to its width.
PASSAGE_EDGE = 1.5
# Angle between a circle and a side that it crosses, relative to the turn of the circle along an edge there.
WEDGE = 3


# Places (k, 2), edge lengths (k,) and growths (k,).
Source = tuple[Float, Float, Float]


def wrap(points: Float, size: Float) -> Float:
    """Wrap positions (n, 2) into the cell [0, size)."""
    wrapped = points % size
    return np.where(wrapped >= size, 0.0, wrapped)


def circle_size(arrangement: Arrangement, largest: float) -> Float:
    """Return the longest edge (k,) on each circle, for MIN_EDGES_AROUND edges or more.

    Edges on a coating with thickness t on the radius a have at most sqrt(t a): then they are t / 8 away from their
    arcs, and elements across the coating do not turn over when their edges are bent.
    """
    shells, disc = arrangement.shells
    caps = np.minimum(largest, 2 * np.pi * shells.radii / MIN_EDGES_AROUND)
    return np.minimum(caps, coating_size(arrangement)[disc])


def coating_size(arrangement: Arrangement) -> Float:
    """Return sqrt(t a) (N,) for coatings of thickness t on discs of radius a, infinite for bare discs."""
    return np.where(arrangement.coated, np.sqrt(arrangement.coating * arrangement.radii), np.inf)


def _between_fibres(circles: Float, size: Float, caps: Float, largest: float) -> Iterator[Source]:
    """Yield facing points of fibres as sources, by the gap and the other fibre's edges."""
    centres, radii = circles[:, :2], circles[:, 2]
    first, second, vector = arrangements.neighbours(centres, size, 2 * radii.max() + largest)
    distance = np.linalg.norm(vector, axis=1)
    gap = distance - radii[first] - radii[second]
    normal = vector / distance[:, None]
    growth = passage_growth(gap, 1 / radii[first] + 1 / radii[second])
    for one, other, sign in ((first, second, 1.0), (second, first, -1.0)):
        length = np.minimum(PASSAGE_EDGE * gap, caps[other] + MAX_GROWTH * gap)
        narrow = length < caps[one]
        places = centres[one] + sign * radii[one, None] * normal
        yield places[narrow], length[narrow], growth[narrow]


def passage_growth(width: Float, curvature: Float) -> Float:
    """Return the growth of edges below twice the width w + c s^2 / 2 of a passage."""
    return np.asarray(np.minimum(MAX_GROWTH, np.sqrt((4 - 2 * PASSAGE_EDGE) * 2 * width * curvature)))


def _at_sides(circles: Float, size: Float, caps: Float, largest: float) -> Iterator[Source]:
    """Yield as sources where circles come near a side: extreme points, feet, crossings."""
    centres, radii = circles[:, :2] % size, circles[:, 2]
    for axis, sign in ((0, -1.0), (0, 1.0), (1, -1.0), (1, 1.0)):
        distance = centres[:, axis] if sign < 0 else size[axis] - centres[:, axis]
        extreme, foot = centres.copy(), centres.copy()
        extreme[:, axis] += sign * radii
        foot[:, axis] += sign * distance
        width = np.abs(distance - radii)
        growth = passage_growth(width, 1 / radii)
        length = np.minimum(PASSAGE_EDGE * width, caps + MAX_GROWTH * width)
        for places, narrow in ((extreme, length < caps), (foot, length < largest)):
            yield places[narrow], length[narrow], growth[narrow]
        angle = np.arccos(np.minimum(distance / radii, 1.0))
        length = angle * radii / WEDGE
        sharp = (length < caps) & (angle > 0)
        for turn in (-1.0, 1.0):
            crossing = foot[sharp]
            crossing[:, 1 - axis] += (turn * radii * np.sin(angle))[sharp]
            yield crossing, length[sharp], np.full(len(crossing), MAX_GROWTH)


def at_vertices(vertices: Float, size: Float) -> Source:
    """Return the vertices, once on the torus, as sources by the distance to the next."""
    places = wrap(vertices, size)
    tree = cKDTree(places, boxsize=size)
    same = tree.query_pairs(1e-9 * size.max(), output_type="ndarray")
    places = np.delete(places, same[:, 1], axis=0)
    # A single vertex is infinitely far from the next.
    distance, _ = cKDTree(places, boxsize=size).query(places, k=2)
    return places, distance[:, 1], np.full(len(places), MAX_GROWTH)


# Size of edges on a circle / largest size, below which elements grow from it: between tiny discs far apart, gmsh would
# interpolate the sizes on their circles.
FINE_CIRCLE = 0.1


@dataclass(frozen=True)
class MeshSizes:
    """The largest edge lengths of a mesh; each is at most the one before.

    Attributes:
        largest: anywhere.
        interface: on the circles.
        tip: at debond tips.
    """

    largest: float
    interface: float
    tip: float

    @classmethod
    def of(cls, cell: cell_section.Cell, has_tips: bool) -> MeshSizes:
        """Return the sizes that a case asks for, in a cell of width 1."""
        interface = cell.mesh_size if cell.interface_size is None else cell.interface_size
        return cls(cell.mesh_size, interface, interface if cell.tip_size is None or not has_tips else cell.tip_size)

    def are_graded(self, arrangement: Arrangement) -> bool:
        """Return whether the mesh is finer on circles or at tips than elsewhere.

        It is on thin coatings and tiny discs.
        """
        return bool(min(self.tip, self.on_circles(arrangement).min()) < self.largest)

    def on_circles(self, arrangement: Arrangement) -> Float:
        """Return the sizes (N,) on the circles of each disc."""
        sizes = np.minimum(self.interface, coating_size(arrangement))
        around = 2 * np.pi * arrangement.radii / MIN_EDGES_AROUND
        return np.where(around < FINE_CIRCLE * self.largest, np.minimum(sizes, around), sizes)


class SizeField:
    """The size h(x) = min(largest, min_k (h_k + g_k |x - x_k|)) on the torus, or a graded size if less.

    Source k acts within the distance `largest` / MAX_GROWTH.

    Attributes:
        largest: size anywhere.
        graded: the size that grows with the distance from lines; None if elements are not graded.
        least: lower bound of the sizes.
    """

    def __init__(
        self,
        sources: Sequence[Source],
        size: Float,
        largest: float,
        graded: FromLines | None = None,
        nearest: int = NEAREST,
        chunk: int = CHUNK,
    ) -> None:
        """Prepare sources on the torus with periods `size` (2,).

        The `nearest` sources count at a position; a query has `chunk` positions.
        """
        self.largest, self.graded = largest, graded
        self._size, self._bound, self._nearest, self._chunk = size, largest / MAX_GROWTH, nearest, chunk
        places, lengths, growths = (np.concatenate(parts) for parts in zip(*sources, strict=True))
        # Where the tree finds no more sources, it returns their number: an infinite length.
        self._lengths, self._growths = np.append(lengths, np.inf), np.append(growths, MAX_GROWTH)
        self.least = min(largest, float(self._lengths.min()), np.inf if graded is None else graded.least)
        self._tree = cKDTree(wrap(places, size), boxsize=size)

    def __call__(self, points: Float) -> Float:
        """Return the sizes (n,) at points (n, 2)."""
        wrapped, count, parts = wrap(points, self._size), min(self._nearest, self._tree.n), []
        for k in range(0, max(1, len(points)), self._chunk):
            some = wrapped[k : k + self._chunk]
            distance, nearest = self._tree.query(some, k=count, distance_upper_bound=self._bound)
            sizes = (self._lengths[nearest] + self._growths[nearest] * distance).reshape(len(some), count)
            parts.append(np.minimum(self.largest, sizes.min(axis=1)))
        sizes = np.concatenate(parts)
        return sizes if self.graded is None else np.minimum(sizes, self.graded(points))


def size_field(arrangement: Arrangement, sizes: MeshSizes, vertices: Float, tips: Float) -> SizeField:
    """Return the edge size on the torus, by passages, vertices, discs and tips.

    The sources (x_k, h_k) are the two faces of each narrow passage between two fibres, or between a fibre and
    a side or corner of the cell, with h_k proportional to its width, and the `vertices` (v, 2) that the mesh
    must have, with the distance to the next one.

    A size is at most h_i + g d at the distance d from a disc, and h_t + g max(0, d - h_t) from one of the `tips`
    (t, 2), so that edges at a tip have the size h_t; the growth g is MAX_GROWTH.
    """
    size, largest, (shells, disc) = arrangement.size, sizes.largest, arrangement.shells
    circles, caps = np.column_stack([shells.centres, shells.radii]), circle_size(arrangement, largest)
    first = np.unique(disc, return_index=True)[1]
    # Where a circle passes near the corner: the corner and the nearest point on the circle.
    offset = (circles[:, :2] + size / 2) % size - size / 2
    distance = np.linalg.norm(offset, axis=1)
    length = PASSAGE_EDGE * np.abs(distance - circles[:, 2])
    close = length < caps
    facing = offset[close] * (1 - circles[close, 2] / distance[close])[:, None]
    corners = np.concatenate([facing, np.zeros_like(facing)])
    sources = [
        *_between_fibres(circles[first], size, caps[first], largest),
        *_at_sides(circles, size, caps, largest),
        (corners, np.tile(length[close], 2), np.full(len(corners), MAX_GROWTH)),
        at_vertices(vertices, size),
    ]
    if not sizes.are_graded(arrangement):
        return SizeField(sources, size, largest)
    # Points h_i apart on the outer circles find the nearest disc.
    lengths, outer = sizes.on_circles(arrangement), circles[first]
    counts = np.ceil(2 * np.pi * outer[:, 2] / lengths).astype(int)
    disc = np.repeat(np.arange(len(counts)), counts)
    angle = 2 * np.pi * (np.arange(len(disc)) - np.repeat(np.cumsum(counts) - counts, counts)) / counts[disc]
    points = on_circle(outer[disc], angle)
    return SizeField(sources, size, largest, FromLines(size, points, disc, lengths, sizes.tip, tips, outer))


class FromLines:
    """The smaller one of h_i + g d and h_t + g max(0, d - h_t), see `size_field`.

    Attributes:
        least: lower bound of the sizes.
    """

    def __init__(
        self,
        size: Float,
        points: Float,
        curve: Int,
        lengths: Float,
        tip: float,
        tips: Float,
        circles: Float | None = None,
    ) -> None:
        """Take the lengths h_i (k,) of curves, their `points` (s, 2), and h_t with the `tips` (t, 2).

        d is measured from the circles (k, 3) of the curves (s,) of points, or without circles from the points.
        """
        self._size, self._curve, self._lengths, self._tip, self._circles = size, curve, lengths, tip, circles
        self._points, self._tips = (cKDTree(wrap(x.reshape(-1, 2), size), boxsize=size) for x in (points, tips))
        self.least = min(tip, float(lengths.min()))

    def __call__(self, points: Float) -> Float:
        """Return the sizes (n,) at positions (n, 2) on the torus."""
        places = wrap(points, self._size)
        distance, nearest = self._points.query(places)
        curve = self._curve[nearest]
        if self._circles is not None:
            circles = self._circles[curve]
            offset = (points - circles[:, :2] + self._size / 2) % self._size - self._size / 2
            distance = np.abs(np.linalg.norm(offset, axis=1) - circles[:, 2])
        # Without tips the distance is infinite.
        at_tips = self._tip + MAX_GROWTH * np.maximum(0.0, self._tips.query(places)[0] - self._tip)
        return np.asarray(np.minimum(self._lengths[curve] + MAX_GROWTH * distance, at_tips))
