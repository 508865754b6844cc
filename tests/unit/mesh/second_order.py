"""Meshes of 6-node triangles, and faults of their middle nodes: name -> (mesh, part of the message)."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from unit.mesh.faulty_meshes import FIBRE, MshFile, grid


def second_order(mesh: MshFile, bent: Callable[[float, float], Sequence[float]] | None = None) -> MshFile:
    """Return the mesh with triangles of six nodes and lines of three; `bent` moves the middles (x, y) of edges."""
    nodes, elements = dict(mesh.nodes), {}
    middle: dict[frozenset[int], int] = {}
    for tag, (kind, physical, entity, corners) in mesh.elements.items():
        if kind == 1:
            elements[tag] = (8, physical, entity, (*corners, middle[frozenset(corners)]))
            continue
        for pair in zip(corners, (*corners[1:], corners[0]), strict=True):
            if frozenset(pair) not in middle:
                x, y = np.mean([mesh.nodes[end][:2] for end in pair], axis=0).tolist()
                middle[frozenset(pair)] = 1000 + len(middle)
                nodes[middle[frozenset(pair)]] = (*(bent(x, y) if bent else (x, y)), 0.0)[:3]
        own = (middle[frozenset(pair)] for pair in zip(corners, (*corners[1:], corners[0]), strict=True))
        elements[tag] = (9, physical, entity, (*corners, *own))
    return replace(mesh, nodes=nodes, elements=elements)


def _middle_moved(x: float, y: float, *place: float) -> MshFile:
    """Return the grid in second order, with the middle node at (x, y) elsewhere."""
    return second_order(grid(), lambda u, v: place if (u, v) == (x, y) else (u, v))


def _two_middles() -> MshFile:
    """Element 11 has a middle node of its own on the edge that it shares with 12."""
    mesh = second_order(grid())
    *nodes, last = mesh.elements[11][3]
    mesh = replace(mesh, nodes={**mesh.nodes, 2000: mesh.nodes[last]})
    return mesh.with_element(11, 9, FIBRE, (*nodes, 2000))


FAULTY_MIDDLES: dict[str, tuple[MshFile, str]] = {
    "nan": (_middle_moved(0.375, 0.25, float("nan"), 0.25), "middle node 1008 (nan, 0.25): coordinates are not finite"),
    "off the plane": (_middle_moved(0.375, 0.25, 0.375, 0.25, 0.1), "middle node 1008 (0.375, 0.25): not in the plane"),
    "off the side": (
        _middle_moved(0.375, 0.0, 0.375, 0.01),
        "middle node 1005 (0.375, 0.01): off the straight side of the cell",
    ),
    "too far": (
        _middle_moved(0.375, 0.25, 0.5, 0.25),
        "middle node 1008 (0.5, 0.25): farther from the middle than half the edge's length",
    ),
    "two on an edge": (_two_middles(), "two middle nodes on an edge: nodes "),
}
