"""Subdomains of one rank that come from several, joined."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from feti_homog.mesh.submesh import Submesh, SubmeshesOfRank
from feti_homog.typing import Array, Int


def joined(parts: Sequence[SubmeshesOfRank]) -> SubmeshesOfRank:
    """The subdomains of all of these, each of which is in one of them."""
    index = _all(parts, "index")
    order = np.argsort(index)
    phase = [name for part in parts for name in part.phase]
    return SubmeshesOfRank(
        whole=_joined_meshes([part.whole for part in parts]),
        member=np.argsort(order)[_numbers(parts, "member", "index")],
        index=index[order],
        body=_all(parts, "body")[order],
        phase=tuple(phase[k] for k in order.tolist()),
    )


def _joined_meshes(meshes: list[Submesh]) -> Submesh:
    """All triangles of these; plane vertices and edges are not identified, classes and torus edges are."""
    class_keys, first_class, class_of = np.unique(_all(meshes, "class_keys"), return_index=True, return_inverse=True)
    edge_keys, first, edge_of = np.unique(_all(meshes, "edge_keys"), return_index=True, return_inverse=True)
    pinned = [np.searchsorted(class_keys, mesh.class_keys[mesh.pinned]) for mesh in meshes if mesh.pinned >= 0]
    return replace(
        meshes[0],
        points=_all(meshes, "points"),
        triangles=_numbers(meshes, "triangles", "points"),
        triangle_edges=_numbers(meshes, "triangle_edges", "edges"),
        backwards=_all(meshes, "backwards"),
        edges=_numbers(meshes, "edges", "points"),
        circles=_all(meshes, "circles"),
        turns=_all(meshes, "turns"),
        vertex_class=class_of[_numbers(meshes, "vertex_class", "class_keys")],
        edge_class=edge_of[_numbers(meshes, "edge_class", "edge_keys")],
        at_void=_all(meshes, "at_void")[first],
        debonded=_all(meshes, "debonded")[first],
        touching=_all(meshes, "touching")[first_class],
        class_keys=class_keys,
        edge_keys=edge_keys,
        pinned=int(pinned[0]) if pinned else -1,
    )


def _all(parts: Sequence[object], name: str) -> Array:
    """What each of the parts has of that name, one after the other."""
    return np.concatenate([getattr(part, name) for part in parts])


def _numbers(parts: Sequence[object], name: str, of: str) -> Int:
    """The same for numbers of what is called `of`, which become numbers in the list of all of these."""
    ends = np.cumsum([0, *(len(getattr(part, of)) for part in parts)])
    return np.concatenate([getattr(part, name) + end for part, end in zip(parts, ends, strict=False)])
