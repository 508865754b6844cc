"""Represent the coarse mesh of a rectangular cell: elements, periodic images of nodes, edges on interfaces."""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from feti_homog.microstructure.shapes import Ellipses
from feti_homog.typing import Bool, Float, Int, Int32

# Distance / cell size below which two nodes coincide: files may round coordinates.
SAME_PLACE = 1e-7
# The triangles on either side of the diagonal 02, and on either side of the diagonal 13.
HALVES = np.array([[[0, 1, 2], [0, 2, 3]], [[0, 1, 3], [1, 2, 3]]])


def on_sides(ends: Float, size: Float) -> Bool:
    """Mark edges with `ends` (k, 2, 2), or points (k, 1, 2), on a side of the rectangle [0, `size`]: mask (k,)."""
    return np.asarray(((ends == 0).all(axis=1) | (ends == size).all(axis=1)).any(axis=1))


def paired_sides(points: Float, period: Float) -> Iterator[tuple[int, Int, Int]]:
    """Yield the pairs of points on opposite sides that differ by one period.

    Args:
        points: (n, 2) nodes or edge middles; coordinates on sides are exactly 0 or the period.
        period: (2,) width and height, or `CoarseMesh.shift` for a cell that may lack periodic images.

    Yields:
        The axis (0, then 1) normal to two sides, the points (k,) on the side at 0, and the partners (k,) on the other
            side, in ascending order along the sides.  Points without a partner, as beside voids, are left out.
    """
    for axis in (0, 1):
        along = points[:, 1 - axis]
        low, high = (np.flatnonzero(points[:, axis] == level) for level in (0.0, period[axis]))
        low, high = (nodes[np.argsort(along[nodes])] for nodes in (low, high))
        if len(low) != len(high) or not np.allclose(along[low], along[high], 0.0, SAME_PLACE * float(np.ptp(points))):
            _, at_low, at_high = np.intersect1d(along[low], along[high], return_indices=True)
            low, high = low[at_low], high[at_high]
        yield axis, low, high


@dataclass(frozen=True)
class CoarseMesh:
    """A conforming mesh of straight triangles or square pixels.

    Attributes:
        width, height: cell periods.
        points: (n, 2) nodes in the plane.
        triangles: (m, 3) counter-clockwise nodes; a triangle has at most one edge on a circle.  Or (m, 4) corners of
            square pixels, the lower left corner first; `refinement.halved` cuts pixels into triangles.
        phase: (m,) index into `phases`; the first phase is "matrix".
        precedence: (m,) sort key for the numbers of constituents: least in the matrix, else the fibre number, or the
            phase if fibres have no numbers.
        representative: (n,) node that represents each node on the torus: the image at x = 0 and y = 0, if any, or
            itself.
        ellipses: k circles and ellipses in the plane; periodic images have separate entries.
        arc_edges: (a, 2) edges with both ends on one ellipse, up to rounding.
        arc_circle: (a,) the ellipse of each edge in `arc_edges`.
        debonded_edges: (d, 2) edges between a fibre and the matrix that are debonded from the start.
        snapped: largest distance by which `repair = "snap"` moved a node of a user's mesh.
        origin: lower left corner of the cell in the coordinates of the user.
        remarks: lines for the user on a fibre table, on fractions in an image, or on a mesh file.
        boundary: conditions on the sides, `periodic`, `displacement` or `traction`; only periodic nodes have images.
        centres: (fibres, 2) fibre centres, or None. With centres, `precedence` numbers the fibres from 1, and then the
            coatings in the same order.
    """

    width: float
    height: float
    points: Float
    triangles: Int32
    phase: Int32
    phases: tuple[str, ...]
    precedence: Int32
    representative: Int32
    ellipses: Ellipses = field(default_factory=lambda: Ellipses.round(np.zeros((0, 3))))
    arc_edges: Int32 = field(default_factory=lambda: np.zeros((0, 2), np.int32))
    arc_circle: Int32 = field(default_factory=lambda: np.zeros(0, np.int32))
    debonded_edges: Int32 = field(default_factory=lambda: np.zeros((0, 2), np.int32))
    snapped: float = 0.0
    origin: tuple[float, float] = (0.0, 0.0)
    remarks: tuple[str, ...] = ()
    centres: Float | None = None
    boundary: str = "periodic"

    @property
    def period(self) -> Float:
        """The width and height (2,) of the cell."""
        return np.array([self.width, self.height])

    @property
    def shift(self) -> Float:
        """The distances (2,) between periodic images; 1e30 for a cell without images."""
        return self.period if self.boundary == "periodic" else np.full(2, 1e30)

    def scaled(self, factor: float) -> "CoarseMesh":
        """Return a mesh with size, points and ellipses times `factor`; `origin`, `centres` and `snapped` stay."""
        mesh = replace(self, width=factor * self.width, height=factor * self.height, points=factor * self.points)
        return replace(mesh, ellipses=self.ellipses.scaled(factor))


def areas(points: Float, triangles: Int32) -> Float:
    """Compute the signed areas (m,) of triangles, positive for counter-clockwise nodes."""
    a, b, c = (points[triangles[:, i]] for i in range(3))
    u, v = b - a, c - a
    return np.asarray(0.5 * (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]))


def edges(triangles: Int32) -> Int32:
    """List the directed edges (3m or 4m, 2) of m elements; row 3t + i or 4t + i joins corners i + 1, i + 2 of t."""
    return np.stack([np.roll(triangles, -1, axis=1), np.roll(triangles, -2, axis=1)], axis=2).reshape(-1, 2)


def edge_keys(pairs: Int32, nodes: int) -> Int:
    """Map undirected edges (k, 2) of a mesh with `nodes` nodes to unique integers (k,)."""
    ordered = np.sort(pairs, axis=1).astype(np.int64)
    return ordered[:, 0] * nodes + ordered[:, 1]


def twins(keys: Int) -> tuple[Int, Int]:
    """Find equal keys among `keys` (n,); return the index arrays (p,) of both members, in ascending order of keys."""
    order = np.argsort(keys, kind="stable")
    same = np.flatnonzero(keys[order][1:] == keys[order][:-1])
    return order[same], order[same + 1]


def representatives(points: Float, width: float, height: float) -> Int32:
    """Return the representative (n,) of each node on the torus.

    The partner at x = 0 represents a node at x = width, the partner at y = 0 a node at y = height, and the origin all
    four corners. Every other node represents itself.
    """
    result = np.arange(len(points), dtype=np.int32)
    for _, low, high in paired_sides(points, np.array([width, height])):
        result[high] = low
    return result[result]


def flip_double_arcs(triangles: Int32, phase: Int32, arc_edges: Int32, arc_circle: Int32, nodes: int) -> Int32:
    """Flip the chords of triangles (m, 3) with two edges on one circle; return all triangles.

    Curved edges would give such a triangle an angle of 180 degrees. Up to eight rounds replace the third edge, a chord,
    by the other diagonal of both triangles at the chord. Chords between phases, and chords with a triangle on one side
    only, stay. `nodes` is the node count.
    """
    triangles = triangles.copy()
    for _ in range(8):
        bad, corner = double_arcs(triangles, arc_edges, arc_circle, nodes)
        one, twin = twins(edge_keys(edges(triangles), nodes))
        opposite = np.full(3 * len(triangles), -1)
        opposite[one], opposite[twin] = twin, one
        other = opposite[3 * bad + corner]
        flippable = (other >= 0) & (phase[other // 3] == phase[bad])
        once = np.isin(np.arange(len(bad)), np.unique(other // 3, return_index=True)[1])
        chosen = flippable & once & ~np.isin(other // 3, bad)
        if not chosen.any():
            break
        t, s, i, j = bad[chosen], other[chosen] // 3, corner[chosen], other[chosen] % 3
        tip, a, b = (triangles[t, (i + step) % 3] for step in range(3))
        far = triangles[s, j]
        triangles[t] = np.stack([tip, a, far], axis=1)
        triangles[s] = np.stack([tip, far, b], axis=1)
    return triangles


def double_arcs(triangles: Int32, arc_edges: Int32, arc_circle: Int32, nodes: int) -> tuple[Int32, Int32]:
    """Find triangles (b,) with two edges on one circle, and the corner (b,) between these; `nodes` counts the nodes."""
    if len(arc_edges) == 0:
        return np.zeros(0, np.int32), np.zeros(0, np.int32)
    keys = edge_keys(arc_edges, nodes)
    order = np.argsort(keys)
    edge_key = edge_keys(edges(triangles), nodes)
    place = order[np.minimum(np.searchsorted(keys[order], edge_key), len(keys) - 1)]
    circle = np.where(keys[place] == edge_key, arc_circle[place], -1).reshape(-1, 3)
    shared = (np.roll(circle, -1, axis=1) == np.roll(circle, 1, axis=1)) & (np.roll(circle, 1, axis=1) >= 0)
    bad = np.flatnonzero(shared.any(axis=1))
    return bad.astype(np.int32), np.argmax(shared[bad], axis=1).astype(np.int32)
