"""Round fibres in a user's mesh: closed interfaces on the torus whose nodes lie on one circle."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components, depth_first_order

from feti_homog.fibres.outlines.ellipses import Ellipses
from feti_homog.mesh.coarse_mesh import CoarseMesh, double_arcs, edge_keys, edges, flip_double_arcs, interface_edges
from feti_homog.mesh.readers.raw_mesh import MiddleNodes
from feti_homog.typing import Bool, Float, Int, Int32

# Largest distance of a node from its circle, relative to the radius: files may round coordinates to seven digits.
ROUNDNESS_TOLERANCE = 1e-6
# A circle has at least so many edges, none longer than the radius: other regular polygons are meant as such.
MIN_CIRCLE_EDGES = 8
# With middle nodes on the circle the same of halves of edges.
MIN_BENT_EDGES, LONGEST_BENT_EDGE = 4, 1.5


@dataclass(frozen=True)
class Loop:
    """A closed interface: its node classes (k,) in order, and where they lie, unwrapped, (k, 2)."""

    classes: Int
    places: Float


def with_circles(mesh: CoarseMesh, middles: MiddleNodes) -> CoarseMesh:
    """Return the mesh with the round interfaces as circles, their nodes moved onto them exactly.

    A closed interface between two phases is a circle if all its nodes are within ROUNDNESS_TOLERANCE radii of one,
    there are at least MIN_CIRCLE_EDGES edges, none on a side of the cell or longer than the radius, and no corner of
    the cell is on it. Where its edges have middle nodes these must lie on it too, and MIN_BENT_EDGES edges are enough.
    Others stay polygons.
    """
    pairs = interface_edges(mesh)
    size = mesh.period
    bends = middles.between(pairs)
    has_middles = len(middles.tags) > 0
    loops = closed_loops(mesh, pairs, size, MIN_BENT_EDGES if has_middles else MIN_CIRCLE_EDGES)
    loop_of = np.full(len(mesh.points), -1)
    for number, loop in enumerate(loops):
        loop_of[loop.classes] = number
    loop_of = loop_of[mesh.representative[pairs[:, 0]]]
    points, circles, arc_edges = mesh.points.copy(), [], []
    for number, loop in enumerate(loops):
        own = pairs[loop_of == number]
        circle = _fit(loop.places, LONGEST_BENT_EDGE if has_middles else 1.0)
        if circle is None or on_sides(mesh.points[own], size).any():
            continue
        moved = _moved(mesh.points[loop.classes], loop.places, circle, size)
        images = _images(mesh, loop, circle, own)
        if moved is None or (has_middles and not _through(images, bends[loop_of == number])):
            continue
        points[loop.classes] = moved
        circles += [image for image, _ in images]
        arc_edges += [own[mine] for _, mine in images]
    mesh = replace(mesh, points=_copied(mesh, points, size))
    return _without_double_arcs(_with_arcs(mesh, circles, arc_edges))


def closed_loops(mesh: CoarseMesh, pairs: Int32, size: Float, least: int) -> list[Loop]:
    """Return the interfaces that are simple closed curves of at least so many edges and contractible on the torus."""
    if len(pairs) == 0:
        return []
    classes, ends = np.unique(mesh.representative[pairs], return_inverse=True)
    ends = ends.reshape(-1, 2)
    vector = mesh.points[pairs[:, 1]] - mesh.points[pairs[:, 0]]
    shape = (len(classes), len(classes))
    rows, columns = np.concatenate([ends, ends[:, ::-1]]).T
    graph = csr_matrix((np.ones(len(rows)), (rows, columns)), shape)
    steps = [csr_matrix((np.append(vector[:, k], -vector[:, k]), (rows, columns)), shape) for k in (0, 1)]
    _, part = connected_components(graph, directed=False)
    branching = np.bincount(part, np.bincount(ends.ravel()) != 2) > 0
    _, first, number = np.unique(part, return_index=True, return_counts=True)
    loops = []
    for start in first[~branching & (number >= least)].tolist():
        order, _ = depth_first_order(graph, start, directed=False)
        hops = np.stack([np.asarray(step[order, np.roll(order, -1)]).ravel() for step in steps], axis=1)
        if np.all(np.abs(hops.sum(axis=0)) < size / 2):
            nodes = classes[order]
            places = mesh.points[nodes[0]] + np.cumsum(hops, axis=0) - hops
            loops.append(Loop(nodes, places))
    return loops


def _fit(places: Float, longest: float) -> Float | None:
    """Centre and radius (3,) of the circle through a closed chain of places (k, 2).

    None if not round, or with edges longer than `longest` radii.
    """
    middle = places.mean(axis=0)
    offset = places - middle
    scale = np.abs(offset).max()
    scaled = offset / scale
    matrix = np.column_stack([2 * scaled, np.ones(len(places))])
    (x, y, rest), *_ = np.linalg.lstsq(matrix, (scaled**2).sum(axis=1), rcond=None)
    radius = np.sqrt(max(rest + x * x + y * y, 0.0))
    spokes = scaled - (x, y)
    away = np.abs(np.linalg.norm(spokes, axis=1) - radius).max()
    chord = np.linalg.norm(np.roll(scaled, -1, axis=0) - scaled, axis=1).max()
    if away > ROUNDNESS_TOLERANCE * radius or chord > longest * radius:
        return None
    return np.array([*(middle + scale * np.array([x, y])), scale * radius])


def _moved(points: Float, places: Float, circle: Float, size: Float) -> Float | None:
    """Points (k, 2) of the plane moved onto the circle, along the side they are on; None if impossible."""
    centres = circle[:2] - np.round((places - points) / size) * size
    spokes = points - centres
    moved: Float = centres + circle[2] * spokes / np.linalg.norm(spokes, axis=1)[:, None]
    on_side = (points == 0) | (points == size)
    if on_side.all(axis=1).any():
        return None
    for axis in (0, 1):
        fixed = np.flatnonzero(on_side[:, axis])
        across = 1 - (spokes[fixed, axis] / circle[2]) ** 2
        # Where the circle nearly touches the side, a node cannot get onto it along the side.
        if np.any(across < 1e-4):
            return None
        moved[fixed, axis] = points[fixed, axis]
        half = np.sign(spokes[fixed, 1 - axis]) * circle[2] * np.sqrt(across)
        moved[fixed, 1 - axis] = centres[fixed, 1 - axis] + half
    return moved


def on_sides(ends: Float, size: Float) -> Bool:
    """Return whether edges with ends (k, 2, 2) lie on a side of the cell."""
    return np.asarray(np.any(np.all(ends == 0, axis=1) | np.all(ends == size, axis=1), axis=1))


def _through(images: list[tuple[Float, Int]], bends: Float) -> bool:
    """Return whether all middle nodes (a, 2) lie on the circles of their edges."""
    away = [np.abs(np.linalg.norm(bends[mine] - image[:2], axis=1) / image[2] - 1) for image, mine in images]
    return bool(np.all(np.concatenate(away) <= ROUNDNESS_TOLERANCE))


def _images(mesh: CoarseMesh, loop: Loop, circle: Float, own: Int32) -> list[tuple[Float, Int]]:
    """Return the images of a circle in the plane, each with the numbers of its edges among the loop's own (a, 2)."""
    return [(np.append(circle[:2] - step, circle[2]), mine) for step, mine in loop_images(mesh, loop, own)]


def loop_images(mesh: CoarseMesh, loop: Loop, own: Int32) -> list[tuple[Float, Int]]:
    """(2,) distance of the loop from each of its images in the plane, and the edges of that among its own (a, 2)."""
    order = np.argsort(loop.classes)
    place = order[np.searchsorted(loop.classes[order], mesh.representative[own[:, 0]])]
    steps = np.round((loop.places[place] - mesh.points[own[:, 0]]) / mesh.period)
    distinct, which = np.unique(steps, axis=0, return_inverse=True)
    which = which.ravel()
    return [(step * mesh.period, np.flatnonzero(which == k)) for k, step in enumerate(distinct)]


def _copied(mesh: CoarseMesh, points: Float, size: Float) -> Float:
    """Points (n, 2) whose periodic copies follow their representatives; those on high sides stay there."""
    return np.where(mesh.points == size, size, points[mesh.representative])


def _with_arcs(mesh: CoarseMesh, circles: list[Float], arc_edges: list[Int32]) -> CoarseMesh:
    """Return the mesh with these circles (3,) and their edges (a, 2)."""
    counts = np.array([len(own) for own in arc_edges], dtype=np.intp)
    return replace(
        mesh,
        ellipses=Ellipses.round(np.array(circles).reshape(-1, 3)),
        arc_edges=np.concatenate([np.zeros((0, 2), np.int32), *arc_edges]),
        arc_circle=np.repeat(np.arange(len(circles), dtype=np.int32), counts),
    )


def _without_double_arcs(mesh: CoarseMesh) -> CoarseMesh:
    """Return the mesh with edges flipped where a triangle has two on one circle; if this fails, it is a polygon."""
    nodes = len(mesh.points)
    triangles = flip_double_arcs(mesh.triangles, mesh.phase, mesh.arc_edges, mesh.arc_circle, nodes)
    bad, _ = double_arcs(triangles, mesh.arc_edges, mesh.arc_circle, nodes)
    if len(bad) == 0:
        return replace(mesh, triangles=triangles)
    keys = edge_keys(mesh.arc_edges, nodes)
    faulty = np.unique(mesh.arc_circle[np.isin(keys, edge_keys(edges(triangles[bad]), nodes))])
    kept = np.setdiff1d(np.arange(len(mesh.circles)), faulty)
    remaining = [mesh.arc_edges[mesh.arc_circle == circle] for circle in kept]
    return _with_arcs(replace(mesh, triangles=triangles), list(mesh.circles[kept]), remaining)
