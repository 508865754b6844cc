"""Triangles of three and of six nodes, as files have them, put together as one mesh."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from feti_homog.mesh.middle_nodes import MiddleNodes
from feti_homog.mesh.readers.mesh_checks import RawMesh
from feti_homog.typing import Float, Int


@dataclass(frozen=True)
class Block:
    """m triangles of a file.

    Their numbers (m,), the numbers of their nodes (m, 3) or (m, 6), corners first and then the middles of the edges 01,
    12, 20, and the group (m,) of each; or quadrilaterals of four nodes (m, 4).
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
    """Return the mesh of the blocks, one at least, with the corner nodes that they use.

    Args:
        node_tags, points: (n,) and (n, 3) numbers and positions of the file's nodes, all that the blocks have among
            them.
        groups: the names of each group.
        curves, containers, aliases: as in `RawMesh`, surfaces first.
    """
    order = np.argsort(node_tags)
    points, known = points[order], node_tags[order]
    blocks = [part for block in blocks for part in _in_triangles(block, known, points)]
    used, triangles = np.unique(np.concatenate([block.nodes[:, :3] for block in blocks]), return_inverse=True)
    bent = [block.nodes for block in blocks if block.nodes.shape[1] == 6]
    six = np.concatenate([np.zeros((0, 6), np.int64), *bent])
    middles = six[:, 3:].ravel()
    return RawMesh(
        node_tags=used,
        points=points[np.searchsorted(known, used)],
        element_tags=np.concatenate([block.tags for block in blocks]),
        triangles=triangles.reshape(-1, 3).astype(np.int32),
        group=np.concatenate([block.group for block in blocks]),
        groups=tuple(groups),
        curves=curves,
        middles=MiddleNodes(
            edges=np.searchsorted(used, six[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)).astype(np.int32),
            tags=middles,
            points=points[np.searchsorted(known, middles)],
        ),
        container=containers[0],
        curve_container=containers[1],
        aliases=tuple(aliases),
    )


def _in_triangles(block: Block, known: Int, points: Float) -> list[Block]:
    """Return a block, quadrilaterals cut in two along the diagonal that leaves the larger of the smaller triangles."""
    if block.nodes.shape[1] != 4:
        return [block]
    x, y = points[np.searchsorted(known, block.nodes)].T[:2]  # (4, m)

    def area(i: int, j: int, k: int) -> Float:
        return np.asarray((x[j] - x[i]) * (y[k] - y[i]) - (x[k] - x[i]) * (y[j] - y[i]))

    halves = np.array([[[0, 1, 2], [0, 2, 3]], [[0, 1, 3], [1, 2, 3]]])
    sense = np.sign(area(0, 1, 2) + area(0, 2, 3))
    least = [np.minimum(*(sense * area(*half) for half in pair)) for pair in halves.tolist()]
    chosen = halves[(least[1] > least[0]).astype(int)]
    return [Block(block.tags, np.take_along_axis(block.nodes, chosen[:, k], axis=1), block.group) for k in (0, 1)]
