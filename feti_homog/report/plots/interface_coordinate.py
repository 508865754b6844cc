"""Where an interface node is along its fibre: its direction, or the arc length where faces may be flat."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components, depth_first_order
from scipy.spatial import cKDTree

from feti_homog.report.plots.interface_marks import SAME_PLACE, InterfaceEdges
from feti_homog.typing import Array

DEGREES = (-180.0, 180.0)
NEAREST = 8  # edges of which the one is looked for that a node lies on


@dataclass(frozen=True)
class Coordinate:
    """The nodes of a fibre in the order of their place along it."""

    nodes: Array  # (k,) rows of /interface
    values: Array  # (k,) ascending
    ends: tuple[float, float]
    label: str


def coordinate(file: Any, edges: InterfaceEdges, body: int) -> Coordinate:
    """Of a body that is a round fibre, or its coating, the direction of the normal, in degrees; of any other the arc
    length, counterclockwise from where the normal is nearest to x1 (around each of its boundaries, if it has several,
    one after the other)."""
    own = np.flatnonzero(file["interface/fibre"][:] == body)
    normal = file["interface/normal"][:]
    radius = file["fibre/radius"][:][np.isin(file["fibre/number"][:], file["interface/fibre_number"][:][own])]
    if np.isfinite(radius).all():
        angle = np.degrees(np.arctan2(normal[own, 1], normal[own, 0]))
        order = np.argsort(angle)
        return Coordinate(own[order], angle[order], DEGREES, "direction of the normal (degrees)")
    period = np.array([file.attrs["width"], file.attrs["height"]])
    chain = np.unique(np.sort(edges.nodes[np.isin(edges.nodes, own).all(axis=1)], axis=1), axis=0)
    length, total = _arc_length(file["interface/points"][:], normal, own, chain, period)
    order = np.argsort(length, kind="stable")
    unit = file.attrs["length_unit"] or "cell units"
    return Coordinate(own[order], length[order], (0.0, total), f"arc length, counterclockwise ({unit})")


def _arc_length(points: Array, normal: Array, own: Array, chain: Array, period: Array) -> tuple[Array, float]:
    """(k,) arc length of the nodes `own`, and that of all boundaries, which the edges (e, 2) of a coarse mesh make."""
    starts, steps, before, total = [], [], [], 0.0
    for line in _lines(chain, normal, points, period):
        sides = _shortest(np.diff(points[line], axis=0), period)
        ends = total + np.cumsum(np.linalg.norm(sides, axis=1))
        starts.append(points[line[:-1]])
        steps.append(sides)
        before.append(np.append(total, ends[:-1]))
        total = float(ends[-1])
    return _along(points[own], np.concatenate(starts), np.concatenate(steps), np.concatenate(before), period), total


def _lines(chain: Array, normal: Array, points: Array, period: Array) -> list[Array]:
    """The boundaries that edges make, each as its nodes in counterclockwise order, of a closed one the first again at
    the end. It begins where the normal is nearest to x1, or at its end if it is open."""
    vertices, ends = np.unique(chain, return_inverse=True)
    first, second = ends.reshape(-1, 2).T
    size = len(vertices)
    pairs = np.append(first, second), np.append(second, first)
    graph = coo_array((np.ones(2 * len(first)), pairs), shape=(size, size)).tocsr()
    degree, (count, label) = np.bincount(pairs[0], minlength=size), connected_components(graph)
    lines = []
    for part in range(count):
        members = np.flatnonzero(label == part)
        closed = bool((degree[members] == 2).all())
        start = members[np.argmax(normal[vertices[members], 0] if closed else -degree[members])]
        line = vertices[depth_first_order(graph, start, return_predecessors=False)]
        line = np.append(line, line[0]) if closed else line
        n1, n2 = normal[line[0]]
        step = _shortest(points[line[1]] - points[line[0]], period)
        lines.append(line if -n2 * step[0] + n1 * step[1] > 0 else line[::-1])
    return lines


def _along(points: Array, starts: Array, steps: Array, before: Array, period: Array) -> Array:
    """(k,) arc length of points: where each is on the nearest edge, from `starts` by `steps` (e, 2)."""
    tree = cKDTree(np.mod(starts + 0.5 * steps, period) % period, boxsize=period)
    near = tree.query(np.mod(points, period) % period, k=min(NEAREST, len(starts)))[1].reshape(len(points), -1)
    offset, step = _shortest(points[:, None] - starts[near] - 0.5 * steps[near], period), steps[near]
    length = np.linalg.norm(step, axis=2)
    share = np.clip(0.5 + (offset * step).sum(axis=2) / length**2, 0.0, 1.0)
    distance = np.linalg.norm(offset - (share - 0.5)[..., None] * step, axis=2)
    best = (distance + SAME_PLACE * length * share).argmin(axis=1)  # a vertex is the start of an edge, not an end
    rows = np.arange(len(points))
    arc: Array = before[near[rows, best]] + (share * length)[rows, best]
    return arc


def _shortest(vectors: Array, period: Array) -> Array:
    """The shortest images of vectors on the torus."""
    shortest: Array = vectors - period * np.round(vectors / period)
    return shortest
