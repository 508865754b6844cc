"""Assemble the triangles and quadrilaterals of a file into one mesh of triangles with corner nodes."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components, dijkstra

from feti_homog.mesh.coarse_mesh import HALVES, edge_keys, edges
from feti_homog.typing import Float, Int, Int32

# The physical curve of edges that are debonded from the start.
DEBONDED = "debonded"
# Ratio of the smaller triangles of both diagonals above which the better diagonal replaces the alternating diagonal.
MUCH_LARGER = 2.0


@dataclass(frozen=True)
class MiddleNodes:
    """The middle nodes on k triangle sides; a side between two triangles has two entries.

    Attributes:
        edges: (k, 2) corner nodes at the ends of each side, numbered from 0.
        tags: (k,) middle node numbers in the file.
        points: (k, 3) middle node positions.
    """

    edges: Int32
    tags: Int
    points: Float

    def between(self, pairs: Int32) -> Float:
        """Return the middle node position (p, 2) of each corner pair (p, 2); NaN without a middle node."""
        nodes, middle = int(max(self.edges.max(initial=0), pairs.max(initial=0))) + 1, np.full((len(pairs), 2), np.nan)
        keys = edge_keys(self.edges, nodes), edge_keys(pairs, nodes)
        _, number, place = np.intersect1d(*keys, return_indices=True)
        middle[place] = self.points[number, :2]
        return middle


@dataclass(frozen=True)
class RawMesh:
    """The triangles of a mesh file, with n corner nodes and m elements.

    Attributes:
        node_tags: (n,) node numbers in the file.
        points: (n, 3) node positions.
        element_tags: (m,) element numbers in the file.
        triangles: (m, 3) nodes, numbered from 0.
        group: (m,) index of each element into `groups`.
        groups: for each group, the names of the physical surfaces or sets that its elements belong to.
        curves: (d, 2) node tags at the line ends in each physical curve or line set, by name.
        middles: the middle nodes in second-order triangles.
        aliases: other names of each group, which a case may select; may be empty.
        container, curve_container: the words of the file format for a group, and for an entry in `curves`.
    """

    node_tags: Int
    points: Float
    element_tags: Int
    triangles: Int32
    group: Int
    groups: tuple[tuple[str, ...], ...]
    curves: Mapping[str, Int]
    middles: MiddleNodes
    container: str
    curve_container: str
    aliases: tuple[tuple[str, ...], ...] = ()

    @property
    def debonded(self) -> Int:
        """The end node tags (d, 2) of the lines in the curve DEBONDED."""
        return self.curves.get(DEBONDED, np.zeros((0, 2), np.int64))

    @property
    def border(self) -> Int32:
        """The edges (k, 2) with a single triangle."""
        pairs = edges(self.triangles)
        _, first, count = np.unique(edge_keys(pairs, len(self.points)), return_index=True, return_counts=True)
        return np.asarray(pairs[first[count == 1]])

    def node(self, number: int) -> str:
        """Describe a node in words: number and position."""
        return f"node {self.node_tags[number]} {at(self.points[number])}"

    def element(self, number: int) -> str:
        """Describe an element in words: number and centre."""
        centre = self.points[self.triangles[number]].mean(axis=0)
        return f"element {self.element_tags[number]} at {at(centre)}"

    def edge(self, pair: Iterable[int]) -> str:
        """Describe an edge in words, by number and position of its ends."""
        return "the edge between " + " and ".join(self.node(int(end)) for end in pair)


def at(point: Float) -> str:
    """Write a position as (x, y)."""
    return f"({point[0]:.9g}, {point[1]:.9g})"


def first_of(names: Iterable[str], total: int, shown: int = 3) -> str:
    """List the first `shown` of `total` names, and count the other names."""
    listed = ", ".join(name for name, _ in zip(names, range(shown), strict=False))
    return listed if total <= shown else f"{listed} and {total - shown} more"


@dataclass(frozen=True)
class Block:
    """A block of m triangles or quadrilaterals in a file.

    Attributes:
        tags: (m,) element numbers.
        nodes: (m, 3), (m, 6), (m, 4), (m, 8) or (m, 9) node numbers: corners, then, in second-order elements, middle
            nodes on the edges 01, 12, ..., then inner nodes.
        group: (m,) group of each element.
    """

    tags: Int
    nodes: Int
    group: Int


def assembled(
    node_tags: Int,
    points: Float,
    blocks: Sequence[Block],
    groups: Sequence[tuple[str, ...]],
    curves: Mapping[str, Int],
    containers: tuple[str, str] = ("physical surface", "physical curve"),
    aliases: Sequence[tuple[str, ...]] = (),
) -> RawMesh:
    """Assemble one or more blocks of elements into one mesh; the nodes are the corner nodes in use.

    Args:
        node_tags, points: (n,) and (n, 3) numbers and positions of all nodes in the file.
        groups: the names of each group.
        curves, aliases: as in `RawMesh`; `containers` is the pair of `container` and `curve_container`.
    """
    order = np.argsort(node_tags)
    points, tags = points[order], node_tags[order]
    sides, middles = [np.zeros((0, 2), np.int64)], [np.zeros(0, np.int64)]
    triangles, quads = list[tuple[Int, Int, Int]](), list[tuple[Int, Int, Int]]()
    for block in blocks:
        count = 3 if block.nodes.shape[1] in (3, 6) else 4
        corners, bent = block.nodes[:, :count], block.nodes[:, count : 2 * count]
        if bent.size:
            sides.append(np.stack([corners, np.roll(corners, -1, axis=1)], axis=2).reshape(-1, 2))
            middles.append(bent.ravel())
        (triangles if count == 3 else quads).append((block.tags, corners, block.group))
    if quads:
        numbers, corners, group = (np.concatenate(parts) for parts in zip(*quads, strict=True))
        halves = tags[in_triangles(np.searchsorted(tags, corners), points)].reshape(-1, 3)
        is_triangle = (halves != np.roll(halves, 1, axis=1)).all(axis=1)  # a repeated corner makes a triangle
        triangles.append((numbers.repeat(2)[is_triangle], halves[is_triangle], group.repeat(2)[is_triangle]))
    numbers, corners, group = (np.concatenate(parts) for parts in zip(*triangles, strict=True))
    used, inner = np.unique(corners, return_inverse=True)
    middle = np.concatenate(middles)
    return RawMesh(
        node_tags=used,
        points=points[np.searchsorted(tags, used)],
        element_tags=numbers,
        triangles=inner.reshape(-1, 3).astype(np.int32),
        group=group,
        groups=tuple(groups),
        curves=curves,
        middles=MiddleNodes(
            edges=np.searchsorted(used, np.concatenate(sides)).astype(np.int32),
            tags=middle,
            points=points[np.searchsorted(tags, middle)],
        ),
        container=containers[0],
        curve_container=containers[1],
        aliases=tuple(aliases),
    )


def in_triangles(corners: Int, points: Float) -> Int:
    """Cut quadrilaterals (m, 4), with corners among points (n, 2 or 3), into pairs of triangles (m, 2, 3).

    Diagonals join nodes that are an even number of sides away from the lowest node of connected quadrilaterals, so that
    they alternate in a grid: parallel diagonals couple stretch and shear.  The other diagonal is used if its smaller
    triangle is MUCH_LARGER times larger or, where even and odd nodes do not alternate, just larger.  The cut depends on
    positions, not on numbers.
    """
    x, y = points[corners].T[:2]  # (4, m)

    def area(i: int, j: int, k: int) -> Float:
        return np.asarray((x[j] - x[i]) * (y[k] - y[i]) - (x[k] - x[i]) * (y[j] - y[i]))

    sense = np.sign(area(0, 1, 2) + area(0, 2, 3))
    first, second = (np.minimum(*(sense * area(*half) for half in pair)) for pair in HALVES.tolist())
    used, inner = np.unique(corners, return_inverse=True)
    n, inner = len(used), inner.reshape(-1, 4)
    ends = inner.ravel(), np.roll(inner, -1, axis=1).ravel()
    sides = coo_matrix((np.ones(len(ends[0])), ends), shape=(n, n)).tocsr()
    order = np.lexsort(points[used, :2].T)
    part = connected_components(sides, directed=False)[1]
    start = order[np.unique(part[order], return_index=True)[1]]
    steps = dijkstra(sides, directed=False, indices=start, unweighted=True, min_only=True)
    even = np.asarray(steps % 2 == 0)[inner]
    preferred = np.where((even != np.roll(even, 1, axis=1)).all(axis=1), np.where(even[:, 0], 1, -1), 0)
    limit = np.where(preferred == 0, 1.0, MUCH_LARGER**preferred)
    return np.take_along_axis(corners[:, None], HALVES[(second > limit * first).astype(int)], axis=2)
