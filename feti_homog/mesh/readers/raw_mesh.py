"""Triangles of three and of six nodes, as a file has them: read block by block, put together as one mesh."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from feti_homog.mesh.coarse_mesh import edge_keys
from feti_homog.mesh.readers.quadrilaterals import in_triangles
from feti_homog.typing import Float, Int, Int32

# The physical curve of the edges that are debonded from the start.
DEBONDED = "debonded"


@dataclass(frozen=True)
class MiddleNodes:
    """Middle nodes of k sides of triangles; a side of two triangles is listed twice.

    Attributes:
        edges: (k, 2) corner nodes at the ends of each side, numbered from 0.
        tags: (k,) the file's numbers of the middle nodes.
        points: (k, 3) their positions.
    """

    edges: Int32
    tags: Int
    points: Float

    @classmethod
    def none(cls) -> MiddleNodes:
        """Return those of triangles of three nodes."""
        return cls(np.zeros((0, 2), np.int32), np.zeros(0, np.int64), np.zeros((0, 3)))

    def between(self, pairs: Int32) -> Float:
        """(p, 2) the middle node between each pair (p, 2) of corner nodes; NaN where there is none."""
        nodes = int(max(self.edges.max(initial=0), pairs.max(initial=0))) + 1
        keys, first = np.unique(edge_keys(self.edges, nodes), return_index=True)
        wanted = edge_keys(pairs, nodes)
        found = np.full((len(pairs), 2), np.nan)
        if len(keys):
            place = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
            known = keys[place] == wanted
            found[known] = self.points[first[place[known]], :2]
        return found


@dataclass(frozen=True)
class RawMesh:
    """Triangles of a mesh file: nodes in use with their tags, elements with their tags and group.

    Attributes:
        node_tags: (n,) the file's numbers of the nodes.
        points: (n, 3) their positions.
        element_tags: (m,) the file's numbers of the elements.
        triangles: (m, 3) nodes, numbered from 0.
        group: (m,) index into `groups`, the names of the physical surfaces or sets that the elements belong to.
        curves: (d, 2) node tags of the ends of the lines in each physical curve or set of lines, by its name.
        middles: the middle nodes of second-order triangles.
        aliases: other names of each group, by which a case may select it; may be empty.
        container, curve_container: what the file calls a group, and an entry of `curves`.
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
        """(d, 2) node tags of the ends of the lines in the curve DEBONDED."""
        return self.curves.get(DEBONDED, np.zeros((0, 2), np.int64))

    def node(self, number: int) -> str:
        """Return a node in words."""
        return f"node {self.node_tags[number]} {at(self.points[number])}"

    def element(self, number: int) -> str:
        """Return an element in words, with the position of its centre."""
        centre = self.points[self.triangles[number]].mean(axis=0)
        return f"element {self.element_tags[number]} at {at(centre)}"

    def edge(self, pair: Iterable[int]) -> str:
        """Return an edge in words."""
        return "the edge between " + " and ".join(self.node(int(end)) for end in pair)


def at(point: Float) -> str:
    """Return a position in words, (x, y)."""
    return f"({point[0]:.9g}, {point[1]:.9g})"


def first_of(names: Iterable[str], total: int, shown: int = 3) -> str:
    """Return the first few names and how many more there are."""
    listed = ", ".join(name for name, _ in zip(names, range(shown), strict=False))
    return listed if total <= shown else f"{listed} and {total - shown} more"


@dataclass(frozen=True)
class Block:
    """m triangles or quadrilaterals of a file.

    Their numbers (m,), the group (m,) of each, and the numbers of their nodes: the corners, then the middles of the
    edges 01, 12, ... of second-order ones, then what is inside; (m, 3) or (m, 6), (m, 4), (m, 8) or (m, 9).
    """

    tags: Int
    nodes: Int
    group: Int

    @property
    def corners(self) -> Int:
        """(m, 3) or (m, 4)."""
        return self.nodes[:, : 3 if self.nodes.shape[1] in (3, 6) else 4]

    @property
    def middles(self) -> Int:
        """(m, 3) or (m, 4) of second-order ones, (m, 0) of others."""
        count = self.corners.shape[1]
        return self.nodes[:, count : 2 * count]


def assembled(
    node_tags: Int,
    points: Float,
    blocks: Sequence[Block],
    groups: Sequence[tuple[str, ...]],
    curves: Mapping[str, Int],
    containers: tuple[str, str] = ("physical surface", "physical curve"),
    aliases: Sequence[tuple[str, ...]] = (),
) -> RawMesh:
    """Return the mesh of the blocks, one at least, with the corner nodes that they use.

    Args:
        node_tags, points: (n,) and (n, 3) numbers and positions of the file's nodes, all that the blocks have among
            them.
        groups: the names of each group.
        curves, containers, aliases: as in `RawMesh`, surfaces first.
    """
    order = np.argsort(node_tags)
    points, known = points[order], node_tags[order]
    sides = [(block.corners, block.middles) for block in blocks if block.middles.size]
    blocks = _in_triangles(blocks, known, points)
    used, triangles = np.unique(np.concatenate([block.nodes for block in blocks]), return_inverse=True)
    bent = [np.stack([nodes, np.roll(nodes, -1, axis=1)], axis=2).reshape(-1, 2) for nodes, _ in sides]
    middles = np.concatenate([np.zeros(0, np.int64), *(own.ravel() for _, own in sides)])
    return RawMesh(
        node_tags=used,
        points=points[np.searchsorted(known, used)],
        element_tags=np.concatenate([block.tags for block in blocks]),
        triangles=triangles.reshape(-1, 3).astype(np.int32),
        group=np.concatenate([block.group for block in blocks]),
        groups=tuple(groups),
        curves=curves,
        middles=MiddleNodes(
            edges=np.searchsorted(used, np.concatenate([np.zeros((0, 2), np.int64), *bent])).astype(np.int32),
            tags=middles,
            points=points[np.searchsorted(known, middles)],
        ),
        container=containers[0],
        curve_container=containers[1],
        aliases=tuple(aliases),
    )


def _in_triangles(blocks: Sequence[Block], known: Int, points: Float) -> list[Block]:
    """Return triangles of three nodes; two triangles for each quadrilateral come last."""
    found = [replace(block, nodes=block.corners) for block in blocks]
    quads = [block for block in found if block.nodes.shape[1] == 4]
    if not quads:
        return found
    tags, nodes, group = (np.concatenate([getattr(q, name) for q in quads]) for name in ("tags", "nodes", "group"))
    halves = known[in_triangles(np.searchsorted(known, nodes), points)].reshape(-1, 3)
    return [b for b in found if b.nodes.shape[1] == 3] + [Block(tags.repeat(2), halves, group.repeat(2))]
