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
    """m triangles of a file: their numbers (m,), the numbers of their nodes (m, 3) or (m, 6), corners first and then
    the middles of the edges 01, 12, 20, and the group (m,) of each."""

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
) -> RawMesh:
    """The mesh of the blocks, one at least, with the corner nodes that they use.

    Args:
        node_tags, points: (n,) and (n, 3) numbers and positions of the file's nodes, all that the blocks have among
            them.
        groups: the names of each group.
        curves, containers: as in `RawMesh`, surfaces first.
    """
    order = np.argsort(node_tags)
    points, known = points[order], node_tags[order]
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
    )
