"""Round and elliptic fibres in a user's mesh: closed interfaces on the torus whose nodes lie on one curve."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components, depth_first_order

from feti_homog.mesh.coarse_mesh import CoarseMesh, double_arcs, edge_keys, edges, flip_double_arcs, interface_edges
from feti_homog.mesh.readers.raw_mesh import MiddleNodes
from feti_homog.microstructure.shapes.ellipses import Ellipses
from feti_homog.typing import Bool, Float, Int, Int32

# Largest distance of a node from its circle, relative to the radius: files may round coordinates to seven digits.
ROUNDNESS_TOLERANCE = 1e-6
# A circle has at least so many edges, none longer than the radius: other regular polygons are meant as such.
MIN_CIRCLE_EDGES = 8
# With middle nodes on the circle the same of halves of edges.
MIN_BENT_EDGES, LONGEST_BENT_EDGE = 4, 1.5
# More edges than a circle: an ellipse has more freedom to go through the corners of a polygon.
MIN_ELLIPSE_EDGES = MIN_CIRCLE_EDGES + 2
# As the longest edges of circles: bent more, elements beside the tips of thin ellipses could turn over.
MOST_BENT = 0.14
# Ratio of semi-axes below which a conic may be a parabola but for rounding.
THINNEST = 1e-4


@dataclass(frozen=True)
class _Loop:
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
    loops = _closed_loops(mesh, pairs, size, MIN_BENT_EDGES if has_middles else MIN_CIRCLE_EDGES)
    loop_of = np.full(len(mesh.points), -1)
    for number, loop in enumerate(loops):
        loop_of[loop.classes] = number
    loop_of = loop_of[mesh.representative[pairs[:, 0]]]
    points, circles, arc_edges = mesh.points.copy(), [], []
    for number, loop in enumerate(loops):
        own = pairs[loop_of == number]
        circle = _fit_circle(loop.places, LONGEST_BENT_EDGE if has_middles else 1.0)
        if circle is None or _on_sides(mesh.points[own], size).any():
            continue
        moved = _moved(mesh.points[loop.classes], loop.places, circle, size)
        images = _images(mesh, loop, circle, own)
        if moved is None or (has_middles and not _through(images, bends[loop_of == number])):
            continue
        points[loop.classes] = moved
        circles += [image for image, _ in images]
        arc_edges += [own[mine] for _, mine in images]
    # Copies follow their representatives; those on high sides stay there.
    mesh = replace(mesh, points=np.where(mesh.points == size, size, points[mesh.representative]))
    ellipses = Ellipses.round(np.array(circles).reshape(-1, 3))
    return _without_double_arcs(with_arcs(mesh, ellipses, *_numbered(arc_edges)))


def _closed_loops(mesh: CoarseMesh, pairs: Int32, size: Float, least: int) -> list[_Loop]:
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
            loops.append(_Loop(nodes, places))
    return loops


def _fit_circle(places: Float, longest: float) -> Float | None:
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


def _on_sides(ends: Float, size: Float) -> Bool:
    """Return whether edges with ends (k, 2, 2) lie on a side of the cell."""
    return np.asarray(np.any(np.all(ends == 0, axis=1) | np.all(ends == size, axis=1), axis=1))


def _through(images: list[tuple[Float, Int]], bends: Float) -> bool:
    """Return whether all middle nodes (a, 2) lie on the circles of their edges."""
    away = [np.abs(np.linalg.norm(bends[mine] - image[:2], axis=1) / image[2] - 1) for image, mine in images]
    return bool(np.all(np.concatenate(away) <= ROUNDNESS_TOLERANCE))


def _images(mesh: CoarseMesh, loop: _Loop, circle: Float, own: Int32) -> list[tuple[Float, Int]]:
    """Return the images of a circle in the plane, each with the numbers of its edges among the loop's own (a, 2)."""
    return [(np.append(circle[:2] - step, circle[2]), mine) for step, mine in _loop_images(mesh, loop, own)]


def _loop_images(mesh: CoarseMesh, loop: _Loop, own: Int32) -> list[tuple[Float, Int]]:
    """(2,) distance of the loop from each of its images in the plane, and the edges of that among its own (a, 2)."""
    order = np.argsort(loop.classes)
    place = order[np.searchsorted(loop.classes[order], mesh.representative[own[:, 0]])]
    steps = np.round((loop.places[place] - mesh.points[own[:, 0]]) / mesh.period)
    distinct, which = np.unique(steps, axis=0, return_inverse=True)
    which = which.ravel()
    return [(step * mesh.period, np.flatnonzero(which == k)) for k, step in enumerate(distinct)]


def with_arcs(mesh: CoarseMesh, ellipses: Ellipses, arcs: Int32, number: Int32) -> CoarseMesh:
    """Return the mesh with more ellipses, and the edges (a, 2) on them, each on that of its number (a,)."""
    return replace(
        mesh,
        ellipses=mesh.ellipses.joined(ellipses),
        arc_edges=np.concatenate([mesh.arc_edges, arcs]),
        arc_circle=np.concatenate([mesh.arc_circle, len(mesh.ellipses) + number]).astype(np.int32),
    )


def _numbered(arcs: list[Int32]) -> tuple[Int32, Int32]:
    """Return the edges (a, 2) of all curves, and the number (a,) of the curve of each."""
    counts = np.array([len(own) for own in arcs], dtype=np.intp)
    ends = np.concatenate([np.zeros((0, 2), np.int32), *arcs])
    return ends, np.repeat(np.arange(len(arcs), dtype=np.int32), counts)


def _without_double_arcs(mesh: CoarseMesh) -> CoarseMesh:
    """Return the mesh with edges flipped where a triangle has two on one circle; if this fails, it is a polygon."""
    nodes = len(mesh.points)
    triangles = flip_double_arcs(mesh.triangles, mesh.phase, mesh.arc_edges, mesh.arc_circle, nodes)
    bad, _ = double_arcs(triangles, mesh.arc_edges, mesh.arc_circle, nodes)
    if len(bad) == 0:
        return replace(mesh, triangles=triangles)
    keys = edge_keys(mesh.arc_edges, nodes)
    faulty = np.unique(mesh.arc_circle[np.isin(keys, edge_keys(edges(triangles[bad]), nodes))])
    kept, remain = np.setdiff1d(np.arange(len(mesh.ellipses)), faulty), ~np.isin(mesh.arc_circle, faulty)
    return replace(
        mesh,
        triangles=triangles,
        ellipses=mesh.ellipses[kept],
        arc_edges=mesh.arc_edges[remain],
        arc_circle=np.searchsorted(kept, mesh.arc_circle[remain]).astype(np.int32),
    )


@dataclass(frozen=True)
class Ellipse:
    """The image centre + frame p of the unit circle |p| = 1; `frame` is (2, 2)."""

    centre: Float
    frame: Float

    def moved(self, step: Float) -> Ellipse:
        """Return the ellipse moved by a vector (2,)."""
        return replace(self, centre=self.centre + step)

    def between(self, start: Float, stop: Float) -> Float:
        """(k, 2) the points at the middle parameter between points (k, 2) on the ellipse less than half of it apart."""
        middle = np.linalg.solve(self.frame, ((start + stop) / 2 - self.centre).T)
        return np.asarray(self.centre + (self.frame @ (middle / np.hypot(*middle))).T)


def with_ellipses(mesh: CoarseMesh, middles: MiddleNodes) -> CoarseMesh:
    """Return the mesh whose elliptic interfaces that are no circles follow their ellipses.

    A closed interface between two phases is an ellipse if all its nodes are within ROUNDNESS_TOLERANCE of one, and it
    has at least MIN_ELLIPSE_EDGES edges, none on a side of the cell, none that spans more than one radian of its
    parameter or that the ellipse leaves by more than MOST_BENT of its length. Where its edges have middle nodes these
    must lie on it too. Others stay as they are. Edges are flipped where a triangle has two on one ellipse.
    """
    pairs, nodes = interface_edges(mesh), len(mesh.points)
    pairs = pairs[~np.isin(edge_keys(pairs, nodes), edge_keys(mesh.arc_edges, nodes))]
    bends, own_ellipses, arcs = middles.between(pairs), [], []
    for loop in _closed_loops(mesh, pairs, mesh.period, MIN_ELLIPSE_EDGES):
        ellipse = fit_ellipse(loop.places)
        own = np.isin(mesh.representative[pairs[:, 0]], loop.classes)
        if ellipse is None or _on_sides(mesh.points[pairs[own]], mesh.period).any():
            continue
        images = _loop_images(mesh, loop, pairs[own])
        places = [(ellipse.moved(-step), pairs[own][mine], bends[own][mine]) for step, mine in images]
        if all(_follow(image, mesh.points[some], bend) for image, some, bend in places):
            own_ellipses += [image for image, _, _ in places]
            arcs += [some for _, some, _ in places]
    if not arcs:
        return mesh
    ellipses = Ellipses(np.array([own.centre for own in own_ellipses]), np.array([own.frame for own in own_ellipses]))
    ends, number = _numbered(arcs)
    triangles = flip_double_arcs(mesh.triangles, mesh.phase, ends, number, nodes)
    return with_arcs(replace(mesh, triangles=triangles), ellipses, ends, number)


def _follow(ellipse: Ellipse, ends: Float, bends: Float) -> bool:
    """Return whether edges may follow the ellipse.

    Their ends are (k, 2, 2) and their middle nodes (k, 2), NaN if there are none.
    """
    chord = ends[:, 1] - ends[:, 0]
    bulge = ellipse.between(ends[:, 0], ends[:, 1]) - ends.mean(axis=1)
    off = np.abs(np.linalg.norm(np.linalg.solve(ellipse.frame, (bends - ellipse.centre).T), axis=0) - 1)
    return bool(np.all(np.hypot(*bulge.T) <= MOST_BENT * np.hypot(*chord.T)) and not np.any(off > ROUNDNESS_TOLERANCE))


def fit_ellipse(places: Float) -> Ellipse | None:
    """Return the ellipse through a closed chain of places (k, 2) in order.

    None if they are on none or too far apart.

    The conic d.A.d + b.d = 1 that fits best, d from the mean of the places, is |F^-1 (d - c)| = 1.
    """
    mean = places.mean(axis=0)
    scale = np.abs(places - mean).max()
    x, y = ((places - mean) / scale).T
    (xx, xy, yy, bx, by), *_ = np.linalg.lstsq(
        np.column_stack([x * x, x * y, y * y, x, y]), np.ones(len(x)), rcond=None
    )
    A = np.array([[xx, xy / 2], [xy / 2, yy]])
    values, axes = np.linalg.eigh(A)
    if values[0] <= THINNEST**2 * values[1]:
        return None
    centre = -np.linalg.solve(A, [bx, by]) / 2
    level = 1 + centre @ A @ centre
    frame = axes * np.sqrt(level / values)
    on_circle = np.linalg.solve(frame, np.stack([x, y]) - centre[:, None])
    chord = np.hypot(*(np.roll(on_circle, -1, axis=1) - on_circle))
    away = np.abs(np.hypot(*on_circle) - 1)
    if away.max() > ROUNDNESS_TOLERANCE or chord.max() > 2 * np.sin(0.5):
        return None
    return Ellipse(mean + scale * centre, scale * frame)
