"""Represent the cell lines (pieces of sides, arcs and bridges), and place nodes by edge sizes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Self

import numpy as np

from feti_homog.errors import MeshError
from feti_homog.mesh.outline.graded_size import SizeField
from feti_homog.microstructure.shapes import on_circle
from feti_homog.system.parallel import distributed_arrays
from feti_homog.typing import Float, Int

# Regions beside a curve that are neither a disc nor a coating.
MATRIX, OUTSIDE = -1, -2
SAMPLES_OF_AN_EDGE = 3


@dataclass(frozen=True)
class Curves:
    """Lines of a cell: bridges, and pieces of sides or circles, counter-clockwise around the cell or disc.

    Attributes:
        node, first: curve k has the nodes node[first[k] : first[k + 1]], from end to end.
        circle: (c,) the circle of each curve; MATRIX for a straight line.
        inside: (c,) the region on the left: the circle around a disc or coating, MATRIX or OUTSIDE.
        outside: (c,) the region on the right: the circle around a coating, MATRIX or OUTSIDE.
    """

    node: Int
    first: Int
    circle: Int
    inside: Int
    outside: Int

    def __len__(self) -> int:
        return len(self.circle)

    @property
    def edges(self) -> tuple[Int, Int]:
        """The nodes (e, 2) of all edges, and the curve (e,) of each edge."""
        counts = np.diff(self.first)
        begin = np.delete(np.arange(len(self.node)), self.first[1:] - 1)
        return self.node[begin[:, None] + [0, 1]], np.repeat(np.arange(len(self)), counts - 1)

    def chosen(self, some: Int) -> Curves:
        """Select the curves with the indices `some` (k,)."""
        counts = np.diff(self.first)[some]
        node = self.node[distributed_arrays.ranges(self.first[some], counts)]
        first = np.concatenate([[0], np.cumsum(counts)])
        return Curves(node, first, self.circle[some], self.inside[some], self.outside[some])

    @classmethod
    def joined(cls, parts: Sequence[tuple[Float, Curves]]) -> tuple[Float, Curves]:
        """Join the points (n, 2) and curves of all parts, and shift node numbers by the points in earlier parts."""
        begin = np.cumsum([0, *(len(points) for points, _ in parts)])
        counts = np.concatenate([np.diff(curves.first) for _, curves in parts])
        curves = cls(
            np.concatenate([curves.node + k for (_, curves), k in zip(parts, begin, strict=False)]),
            np.concatenate([[0], np.cumsum(counts)]),
            *(np.concatenate([getattr(curves, x) for _, curves in parts]) for x in ("circle", "inside", "outside")),
        )
        return np.concatenate([points for points, _ in parts]), curves


class Lines:
    """The base class of c lines, such as arcs; each attribute is an array (c, ...).

    Attributes:
        cap: (c, 2) longest allowed edge at both ends of each line; the limit varies linearly between the ends.
    """

    cap: Float

    @property
    def lengths(self) -> Float:
        """The length (c,) of each line."""
        raise NotImplementedError

    def points(self, line: Int, share: Float) -> Float:
        """Return the points (n, 2) at the fractions `share` (n,) of the lines `line` (n,)."""
        raise NotImplementedError

    def __len__(self) -> int:
        return len(self.lengths)

    def chosen(self, some: slice) -> Self:
        """Return the lines in the slice `some`."""
        return type(self)(**{name: values[some] for name, values in vars(self).items()})


@dataclass(frozen=True)
class Arcs(Lines):
    """Arcs of circles.

    Attributes:
        circles: (a, 3) centre and radius.
        start, span: (a,) first angle of each arc, and the angle that the arc spans, in radians.
    """

    circles: Float
    start: Float
    span: Float
    cap: Float

    @property
    def lengths(self) -> Float:
        """The length (a,) of each arc."""
        return np.asarray(self.span * self.circles[:, 2])

    def points(self, line: Int, share: Float) -> Float:
        """Return the points (n, 2) at the fractions `share` (n,) of the arcs `line` (n,)."""
        return on_circle(self.circles[line], self.start[line] + self.span[line] * share)


@dataclass(frozen=True)
class Segments(Lines):
    """Straight lines.

    Attributes:
        begin, way: (s, 2) first end of each line, and vector from the first to the second end.
    """

    begin: Float
    way: Float
    cap: Float

    @property
    def lengths(self) -> Float:
        """The length (s,) of each segment."""
        return np.asarray(np.linalg.norm(self.way, axis=1))

    def points(self, line: Int, share: Float) -> Float:
        """Return the points (n, 2) at the fractions `share` (n,) of the segments `line` (n,)."""
        return np.asarray(self.begin[line] + share[:, None] * self.way[line])


@dataclass(frozen=True)
class Sampling:
    """The numbers of sample positions for the edge size, and the limit for nodes.

    Attributes:
        arc, side, bridge: positions along an arc, a piece of a side and a bridge.
        most_nodes: limit for the nodes on all arcs, on one side, or on all bridges.
    """

    arc: int
    side: int
    bridge: int
    most_nodes: int


# For cells that one rank meshes in minutes, and for cells that all ranks mesh: these have arcs of a few edges.
WHOLE, IN_TILES = Sampling(65, 513, 17, 120_000), Sampling(17, 129, 17, 3_000_000)


@dataclass(frozen=True)
class Stations:
    """The positions of nodes on c lines.

    Attributes:
        share: (n,) fraction of the line length before each node, from 0 to 1.
        first: (c + 1,) line k has the nodes first[k] : first[k + 1].
        edges: the edge count before rounding: int ds / h over all lines, with the edge size h.
    """

    share: Float
    first: Int
    edges: float

    @property
    def line(self) -> Int:
        """The line (n,) of each node."""
        return np.repeat(np.arange(len(self.first) - 1), np.diff(self.first))

    @classmethod
    def joined(cls, parts: Sequence[Stations], limit: int) -> Stations:
        """Concatenate the nodes of all parts, in this order.  Raises MeshError for more than `limit` edges in total."""
        edges = sum(part.edges for part in parts)
        _refuse_many(edges, limit)
        counts = np.concatenate([np.diff(part.first) for part in parts])
        return cls(np.concatenate([part.share for part in parts]), np.concatenate([[0], np.cumsum(counts)]), edges)


def _refuse_many(edges: float, limit: int) -> None:
    if edges > limit:
        hint = "make mesh_size and interface_size larger, or fibre_fraction or fibres smaller"
        raise MeshError(f"[cell] the lines of the cell need about {edges:.2g} nodes; expected at most {limit}: {hint}")


def place_nodes(field: SizeField, lines: Lines, least_samples: int, least_edges: Int | int, limit: int) -> Stations:
    """Place nodes on lines at equal steps of the integral of ds / h, with the edge size h.

    h is the size in `field`, limited by `lines.cap`, and sampled at `least_samples` equidistant positions of each line;
    for graded sizes, also at SAMPLES_OF_AN_EDGE or more positions on each edge. Each line has at least `least_edges`
    edges, () or (c,). Raises MeshError for more than about `limit` nodes.
    """
    lengths = lines.lengths

    def size_at(line: Int, share: Float) -> Float:
        low, high = lines.cap[line].T
        return np.asarray(np.minimum(field(lines.points(line, share)), low + share * (high - low)))

    line, samples = np.repeat(np.arange(len(lengths)), least_samples), np.linspace(0, 1, least_samples)
    samples = np.tile(samples, len(lengths))
    sizes = size_at(line, samples)
    while field.graded is not None:
        way = np.diff(samples) * lengths[line[:-1]]
        wide = (np.diff(line) == 0) & (way > 1 / SAMPLES_OF_AN_EDGE * np.minimum(sizes[:-1], sizes[1:]))
        if not wide.any():
            break
        index = np.flatnonzero(wide) + 1
        middle, owner = (samples[index - 1] + samples[index]) / 2, line[index]
        sizes = np.insert(sizes, index, size_at(owner, middle))
        line, samples = np.insert(line, index, owner), np.insert(samples, index, middle)
    density, begin = lengths[line] / sizes, np.searchsorted(line, np.arange(len(lengths) + 1))
    # int ds / h from the beginning of each line, by the trapezoidal rule.
    measure, counts, last = np.zeros(len(samples)), np.diff(begin), begin[1:] - 1
    for count in np.unique(counts):
        rows = begin[:-1][counts == count, None] + np.arange(count)
        d, s = density[rows], samples[rows]
        measure[rows[:, 1:]] = np.cumsum((d[:, 1:] + d[:, :-1]) / 2 * np.diff(s, axis=1), axis=1)
    total = measure[last]
    _refuse_many(float(total.sum()), limit)
    edges = np.maximum(np.ceil(total - 1e-6).astype(int), least_edges)
    first = np.concatenate([[0], np.cumsum(edges + 1)])
    line = np.repeat(np.arange(len(edges)), edges + 1)
    target = (np.arange(first[-1]) - first[line]) * (total / edges)[line]
    target[first[1:] - 1] = total
    # Interpolate in one ascending row with the samples of all lines, which are 1 apart; the rounding of large sums may
    # shift the interval by one.
    shift = np.concatenate([[0.0], np.cumsum(total + 1)])[: len(last)]
    row = measure + np.repeat(shift, counts)
    j = np.searchsorted(row, target + shift[line], side="right") - 1
    j = np.clip(j, begin[line], last[line] - 1)
    j = np.maximum(j - (measure[j] > target), begin[line])
    j = np.minimum(j + (measure[j + 1] <= target), last[line] - 1)
    slope = (samples[j + 1] - samples[j]) / (measure[j + 1] - measure[j])
    share = np.where(target == total[line], 1.0, slope * (target - measure[j]) + samples[j])
    return Stations(share, first, float(total.sum()))


# The nodes of the arcs and the nodes of the bridges.
LineStations = tuple[Stations, Stations]


@dataclass(frozen=True)
class SizedLines:
    """Arcs and bridges whose nodes do not depend on other lines, so that ranks can divide the work."""

    arcs: Lines
    bridges: Lines
    sampling: Sampling

    def parts(self, count: int) -> list[SizedLines]:
        """Divide the lines, in order, into `count` parts of nearly equal size."""
        arcs, bridges = (distributed_arrays.even(len(lines), count) for lines in (self.arcs, self.bridges))
        ends = zip(pairwise(arcs), pairwise(bridges), strict=True)
        return [SizedLines(self.arcs.chosen(slice(*a)), self.bridges.chosen(slice(*b)), self.sampling) for a, b in ends]

    def stations(self, field: SizeField) -> LineStations:
        """Place the nodes on the arcs and bridges.  Raises MeshError for more than `sampling.most_nodes` nodes."""
        sampling = self.sampling
        arcs = place_nodes(field, self.arcs, sampling.arc, 1, sampling.most_nodes)
        return arcs, place_nodes(field, self.bridges, sampling.bridge, 1, sampling.most_nodes)

    def joined(self, parts: Sequence[LineStations]) -> LineStations:
        """Concatenate the nodes of all `parts`.  Raises MeshError for more nodes than `sampling.most_nodes`."""
        arcs, bridges = (Stations.joined(stations, self.sampling.most_nodes) for stations in zip(*parts, strict=True))
        return arcs, bridges
