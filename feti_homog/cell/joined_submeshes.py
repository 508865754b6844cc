"""Subdomains of one rank that come from several, joined."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from feti_homog.cell.submesh import Submesh, SubmeshesOfRank
from feti_homog.typing import Array, Int


def joined(parts: Sequence[SubmeshesOfRank]) -> SubmeshesOfRank:
    """The subdomains of all of these, each of which is in one of them."""
    index = np.concatenate([part.index for part in parts])
    order = np.argsort(index)
    place = np.empty_like(order)
    place[order] = np.arange(len(order))
    phase = [name for part in parts for name in part.phase]
    return SubmeshesOfRank(
        whole=_joined_meshes([part.whole for part in parts]),
        member=place[_shifted([part.member for part in parts], [part.index for part in parts])],
        index=index[order],
        body=np.concatenate([part.body for part in parts])[order],
        phase=tuple(phase[k] for k in order.tolist()),
    )


def _joined_meshes(meshes: list[Submesh]) -> Submesh:
    """All triangles of these; plane vertices and edges are not identified, classes and torus edges are."""
    points, edges = [mesh.points for mesh in meshes], [mesh.edges for mesh in meshes]
    class_keys, edge_keys = [mesh.class_keys for mesh in meshes], [mesh.edge_keys for mesh in meshes]
    classes, class_of = np.unique(np.concatenate(class_keys), return_inverse=True)
    torus_edges, first, edge_of = np.unique(np.concatenate(edge_keys), return_index=True, return_inverse=True)
    vertex_class = class_of[_shifted([mesh.vertex_class for mesh in meshes], class_keys)]
    pinned = [np.searchsorted(classes, mesh.class_keys[mesh.pinned]) for mesh in meshes if mesh.pinned >= 0]
    return replace(
        meshes[0],
        points=np.concatenate(points),
        triangles=_shifted([mesh.triangles for mesh in meshes], points),
        triangle_edges=_shifted([mesh.triangle_edges for mesh in meshes], edges),
        backwards=np.concatenate([mesh.backwards for mesh in meshes]),
        edges=_shifted(edges, points),
        circles=np.concatenate([mesh.circles for mesh in meshes]),
        turns=np.concatenate([mesh.turns for mesh in meshes]),
        vertex_class=vertex_class,
        edge_class=edge_of[_shifted([mesh.edge_class for mesh in meshes], edge_keys)],
        at_void=np.concatenate([mesh.at_void for mesh in meshes])[first],
        debonded=np.concatenate([mesh.debonded for mesh in meshes])[first],
        class_keys=classes,
        edge_keys=torus_edges,
        pinned=int(pinned[0]) if pinned else -1,
    )


def _shifted(numbers: Sequence[Int], of: Sequence[Array]) -> Int:
    """Numbers of things, list after list, in the list of all of them, one list `of` them after the other."""
    ends = np.cumsum([0, *map(len, of)])
    return np.concatenate([own + end for own, end in zip(numbers, ends, strict=False)])
