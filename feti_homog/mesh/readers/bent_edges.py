"""Edges of second-order triangles: what is wrong with their middle nodes, and the arcs through them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from feti_homog.mesh.coarse_mesh import CoarseMesh, edge_keys, flip_double_arcs, interface_edges
from feti_homog.mesh.periodic_topology import components
from feti_homog.mesh.readers.mesh_checks import SAME_PLACE
from feti_homog.mesh.readers.raw_mesh import MiddleNodes, RawMesh, at, first_of
from feti_homog.mesh.readers.round_interfaces import with_arcs
from feti_homog.microstructure.shapes.ellipses import Ellipses
from feti_homog.typing import Bool, Float, Int32

# Distance of a middle node from its edge / length of the edge up to which the edge is straight.
STRAIGHT = 1e-5


def faults(mesh: RawMesh) -> list[str]:
    """Middle nodes that are not finite, off the plane, not shared, off a straight side of the cell, or too far away."""
    middles, plane = mesh.middles, mesh.points[:, :2]
    if len(middles.tags) == 0:
        return []
    finite = np.isfinite(middles.points).all(axis=1)
    places = np.where(finite[:, None], middles.points, mesh.points[middles.edges].mean(axis=1))
    near = SAME_PLACE * np.ptp(plane, axis=0).max()
    start, stop = plane[middles.edges[:, 0]], plane[middles.edges[:, 1]]
    off_side = np.zeros(len(start), bool)
    for side in (plane.min(axis=0), plane.max(axis=0)):
        on_side = (np.abs(start - side) < near) & (np.abs(stop - side) < near)
        off_side |= np.any(on_side & (np.abs(places[:, :2] - side) > near), axis=1)
    along, away, length = _offsets(places[:, :2], start, stop)
    return [
        *_faults(mesh, ~finite, "coordinates are not finite"),
        *_faults(mesh, np.abs(places[:, 2] - mesh.points[0, 2]) > near, "not in the plane"),
        *_faults(mesh, off_side, "off the straight side of the cell"),
        *_faults(mesh, np.hypot(along, away) >= length / 2, "farther from the middle than half the edge's length"),
        *_unshared(mesh),
    ]


def with_bent_edges(mesh: CoarseMesh, middles: MiddleNodes) -> CoarseMesh:
    """Return the mesh whose interface edges follow the circle through their ends and their middle node.

    Those already on circles stay there, and so do straight ones, whose middle node is within STRAIGHT of the chord.
    Edges are flipped where a triangle has two on one curve, which has no corner there.
    """
    pairs, nodes = interface_edges(mesh), len(mesh.points)
    pairs = pairs[~np.isin(edge_keys(pairs, nodes), edge_keys(mesh.arc_edges, nodes))]
    a, b, middle = mesh.points[pairs[:, 0]], mesh.points[pairs[:, 1]], middles.between(pairs)
    _, away, length = _offsets(middle, a, b)
    bent = np.abs(away) > STRAIGHT * length
    circles, arcs = _circumcircles(a[bent], b[bent], middle[bent]), pairs[bent].astype(np.int32)
    triangles = flip_double_arcs(mesh.triangles, mesh.phase, arcs, _curves(mesh, arcs), nodes)
    number = np.arange(len(circles), dtype=np.int32)
    return with_arcs(replace(mesh, triangles=triangles), Ellipses.round(circles), arcs, number)


def _curves(mesh: CoarseMesh, pairs: Int32) -> Int32:
    """(k,) which edges (k, 2) are connected."""
    start, stop = mesh.representative[pairs].T
    return np.asarray(components(len(mesh.points), start, stop)[start], np.int32)


def _offsets(middle: Float, start: Float, stop: Float) -> tuple[Float, Float, Float]:
    """Offsets of middle nodes from the middle of the chord: along it and across it, and the length of the chord."""
    chord, offset = stop - start, middle - (start + stop) / 2
    length = np.hypot(*chord.T)
    along = (chord * offset).sum(axis=1) / length
    across = (chord[:, 0] * offset[:, 1] - chord[:, 1] * offset[:, 0]) / length
    return along, across, length


def _circumcircles(a: Float, b: Float, c: Float) -> Float:
    """(k, 3) centre and radius of the circles through three points each."""
    u, v = b - a, c - a
    twice = 2 * (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
    uu, vv = (u**2).sum(axis=1), (v**2).sum(axis=1)
    x, y = (v[:, 1] * uu - u[:, 1] * vv) / twice, (u[:, 0] * vv - v[:, 0] * uu) / twice
    return np.column_stack([a[:, 0] + x, a[:, 1] + y, np.hypot(x, y)])


def _unshared(mesh: RawMesh) -> list[str]:
    """Edges whose two triangles have different middle nodes."""
    keys = edge_keys(mesh.middles.edges, len(mesh.points))
    order = np.argsort(keys, kind="stable")
    twice = keys[order][1:] == keys[order][:-1]
    here, there = order[:-1][twice], order[1:][twice]
    different = mesh.middles.tags[here] != mesh.middles.tags[there]
    names = (
        f"nodes {mesh.middles.tags[i]} and {mesh.middles.tags[j]} on {mesh.edge(mesh.middles.edges[i])}"
        for i, j in zip(here[different], there[different], strict=True)
    )
    count = int(np.count_nonzero(different))
    return [f"two middle nodes on an edge: {first_of(names, count)}"] if count else []


def _faults(mesh: RawMesh, bad: Bool, what: str) -> list[str]:
    """One line about the middle nodes at fault."""
    middles = mesh.middles
    found = np.flatnonzero(bad)
    tags, first = np.unique(middles.tags[found], return_index=True)
    names = (f"middle node {middles.tags[k]} {at(middles.points[k])}" for k in found[first])
    return [f"{first_of(names, len(tags))}: {what}"] if len(tags) else []
