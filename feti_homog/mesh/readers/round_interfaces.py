"""Bend the interface edges `pairs` (k, 2) of users' meshes to circles, to ellipses, or through their middle nodes."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import reduce

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components, depth_first_order

from feti_homog.mesh.coarse_mesh import CoarseMesh, double_arcs, edge_keys, edges, flip_double_arcs
from feti_homog.mesh.periodic_topology import components
from feti_homog.mesh.readers.raw_mesh import MiddleNodes, first_of
from feti_homog.microstructure.shapes import Ellipses
from feti_homog.typing import Float, Int, Int32

# Largest distance of a node from its circle, relative to the radius: files may round coordinates to seven digits.
ROUNDNESS_TOLERANCE = 1e-6
# The same distance, up to which coarser rounding may have made a polygon of a circle.
NEARLY_ROUND = 1e4 * ROUNDNESS_TOLERANCE
# Least number of edges on a circle or, with middle nodes, of edge halves: regular polygons with fewer edges stay
# polygons.
MIN_CIRCLE_EDGES = 8
# An ellipse, with more parameters than a circle, can pass through the corners of more polygons.
MIN_ELLIPSE_EDGES = MIN_CIRCLE_EDGES + 2
# Rise / length of a circle edge as long as the radius, which spans 60 degrees.  With larger ratios, elements beside the
# tips of thin ellipses could turn over.
MOST_BENT = 1 - np.sqrt(3) / 2
# Distance of a middle node from the chord, in chord lengths, up to which an edge is straight.
STRAIGHT = 1e-5


def with_circles(mesh: CoarseMesh, pairs: Int32, middles: MiddleNodes) -> CoarseMesh:
    """Replace round interfaces by circles, and move interface nodes exactly onto the circles.

    A closed interface between two phases is a circle if all nodes are within ROUNDNESS_TOLERANCE radii of a circle, and
    the interface has at least MIN_CIRCLE_EDGES edges, no edge on a cell side or longer than the radius, and no cell
    corner. Middle nodes cut edges in two. In triangles with two edges on one circle, the third edge flips. If this edge
    cannot flip, the circle stays a polygon, as do other interfaces.
    """
    points, circles, arcs = mesh.points.copy(), list[Ellipses](), list[Int32]()
    for classes, places, chain, loop in _closed_loops(mesh, pairs, middles, MIN_CIRCLE_EDGES):
        # The circle |d|^2 = 2 c.d + r^2 - |c|^2 that fits best, with offsets d from the mean.
        mean = places.mean(axis=0)
        scale = np.abs(places - mean).max()
        d = (places - mean) / scale
        (x, y, rest), *_ = np.linalg.lstsq(np.column_stack([2 * d, np.ones(len(d))]), (d**2).sum(axis=1), rcond=None)
        radius = np.sqrt(max(rest + x * x + y * y, 0.0))
        circle = Ellipses.round(np.array([[*(mean + scale * np.array([x, y])), scale * radius]]))
        is_round = _distance(circle, chain) <= ROUNDNESS_TOLERANCE
        moved = _moved(mesh.points[classes], places, circle, mesh.period) if is_round else None
        if moved is None:
            continue
        points[classes] = moved
        circles += [circle.at(circle.centres - step) for step, _ in loop]
        arcs += [pairs[edges] for _, edges in loop]
    # Copies move like their representatives, but stay on the right or upper side.
    mesh = replace(mesh, points=np.where(mesh.points == mesh.period, mesh.period, points[mesh.representative]))
    mesh = _with_arcs(mesh, circles, arcs)
    nodes = len(mesh.points)
    triangles = flip_double_arcs(mesh.triangles, mesh.phase, mesh.arc_edges, mesh.arc_circle, nodes)
    bad, _ = double_arcs(triangles, mesh.arc_edges, mesh.arc_circle, nodes)
    faulty = np.isin(edge_keys(mesh.arc_edges, nodes), edge_keys(edges(triangles[bad]), nodes))
    remain = ~np.isin(mesh.arc_circle, mesh.arc_circle[faulty])
    remaining = np.setdiff1d(np.arange(len(mesh.ellipses)), mesh.arc_circle[faulty])
    return replace(
        mesh,
        triangles=triangles,
        ellipses=mesh.ellipses[remaining],
        arc_edges=mesh.arc_edges[remain],
        arc_circle=np.searchsorted(remaining, mesh.arc_circle[remain]).astype(np.int32),
    )


def with_ellipses(mesh: CoarseMesh, pairs: Int32, middles: MiddleNodes) -> CoarseMesh:
    """Replace elliptic interfaces that are not circles by ellipses.

    A closed interface between two phases is an ellipse if all nodes are within ROUNDNESS_TOLERANCE semi-axes of an
    ellipse, and the interface has at least MIN_ELLIPSE_EDGES edges. An edge must not lie on a cell side, span more than
    60 degrees of the ellipse parameter, or rise more than MOST_BENT edge lengths to its arc. Middle nodes cut edges in
    two. The third edge flips in triangles with two edges on one ellipse. A remark lists interfaces that are only within
    NEARLY_ROUND and have no middle nodes.
    """
    nodes = len(mesh.points)
    pairs = pairs[~np.isin(edge_keys(pairs, nodes), edge_keys(mesh.arc_edges, nodes))]
    ellipses, arcs, polygons = list[Ellipses](), list[Int32](), list[str]()
    for _, places, chain, loop in _closed_loops(mesh, pairs, middles, MIN_ELLIPSE_EDGES):
        ellipse, onward = fit_ellipse(places, NEARLY_ROUND), np.roll(places, -1, axis=0)
        if ellipse is None:
            continue
        distance = _distance(ellipse, chain)
        if distance > ROUNDNESS_TOLERANCE:
            if len(chain) == len(places):
                (a, b), (x, y) = ellipse.semi_axes[0], ellipse.centres[0] % mesh.period + mesh.origin
                polygons.append(f"semi-axes {a:.5g} and {b:.5g} around ({x:.5g}, {y:.5g}), off by {a * distance:.2g}")
            continue
        # The ray to m, the middle of an edge, leaves the ellipse at m / |F^-1 m|.
        m = (places + onward) / 2 - ellipse.centres
        rise = np.hypot(*m.T) * (1 / np.hypot(*np.linalg.solve(ellipse.frames[0], m.T)) - 1)
        if np.all(rise <= MOST_BENT * np.hypot(*(onward - places).T)):
            ellipses += [ellipse.at(ellipse.centres - step) for step, _ in loop]
            arcs += [pairs[edges] for _, edges in loop]
    added = _with_arcs(mesh, ellipses, arcs)
    ends, number = added.arc_edges[len(mesh.arc_edges) :], added.arc_circle[len(mesh.arc_edges) :]
    advice = "these outlines are polygons; if they should be round, write coordinates with more digits"
    remarks = (f"nodes near circles or ellipses, but not on them: {first_of(polygons, len(polygons))}: {advice}",)
    triangles = flip_double_arcs(mesh.triangles, mesh.phase, ends, number, nodes)
    return replace(added, triangles=triangles, remarks=remarks if polygons else ())


def with_bent_edges(mesh: CoarseMesh, pairs: Int32, middles: MiddleNodes) -> CoarseMesh:
    """Bend each interface edge to the circle through both ends and the middle node.

    Edges on circles and ellipses do not change, nor do edges without a middle node, or with a middle node within
    STRAIGHT edge lengths of the chord. The third edge flips in triangles with two edges on one smooth curve.
    """
    nodes = len(mesh.points)
    pairs = pairs[~np.isin(edge_keys(pairs, nodes), edge_keys(mesh.arc_edges, nodes))]
    start, stop, middle = mesh.points[pairs[:, 0]], mesh.points[pairs[:, 1]], middles.between(pairs)
    chord, offset = stop - start, middle - (start + stop) / 2
    length = np.hypot(*chord.T)
    across = (chord[:, 0] * offset[:, 1] - chord[:, 1] * offset[:, 0]) / length
    bent = np.abs(across) > STRAIGHT * length
    arcs, a = pairs[bent].astype(np.int32), start[bent]
    # The circle through a, a + u and a + v.
    u, v = chord[bent], middle[bent] - a
    twice = 2 * (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
    uu, vv = (u**2).sum(axis=1), (v**2).sum(axis=1)
    x, y = (v[:, 1] * uu - u[:, 1] * vv) / twice, (u[:, 0] * vv - v[:, 0] * uu) / twice
    circles = np.column_stack([a[:, 0] + x, a[:, 1] + y, np.hypot(x, y)])
    ends = mesh.representative[arcs].T
    curves = np.asarray(components(nodes, *ends)[ends[0]], np.int32)
    triangles = flip_double_arcs(mesh.triangles, mesh.phase, arcs, curves, nodes)
    return _with_arcs(replace(mesh, triangles=triangles), [Ellipses.round(circles)], [*arcs[:, None]])


def _with_arcs(mesh: CoarseMesh, curves: Sequence[Ellipses], arcs: Sequence[Int32]) -> CoarseMesh:
    """Add the ellipses `curves` to the mesh, and the edges `arcs`, an array (a, 2) for each ellipse."""
    number = np.repeat(np.arange(len(arcs)), np.array([len(pairs) for pairs in arcs], np.intp))
    return replace(
        mesh,
        ellipses=reduce(Ellipses.joined, curves, mesh.ellipses),
        arc_edges=np.concatenate([mesh.arc_edges, *arcs]),
        arc_circle=np.concatenate([mesh.arc_circle, len(mesh.ellipses) + number]).astype(np.int32),
    )


def _closed_loops(
    mesh: CoarseMesh, pairs: Int32, middles: MiddleNodes, fewest: int
) -> Iterator[tuple[Int, Float, Float, list[tuple[Float, Int]]]]:
    """Yield closed interfaces, off the cell sides and without branches, that are contractible on the torus.

    An interface has at least `fewest` edges or, with middle nodes, edge halves.

    Yields:
        Node classes (k,) in order, unwrapped positions (k, 2) of the classes, unwrapped positions of corner and middle
            nodes in order, and for each image in the plane the shift (2,) to the unwrapped positions and the interface
            edges.
    """
    if len(pairs) == 0:
        return
    size, bends = mesh.period, middles.between(pairs)
    classes, ends = np.unique(mesh.representative[pairs], return_inverse=True)
    ends = ends.reshape(-1, 2)
    vector = mesh.points[pairs[:, 1]] - mesh.points[pairs[:, 0]]
    shape = (len(classes), len(classes))
    rows, columns = np.concatenate([ends, ends[:, ::-1]]).T
    graph = csr_matrix((np.ones(len(rows)), (rows, columns)), shape)
    steps = [csr_matrix((np.append(vector[:, k], -vector[:, k]), (rows, columns)), shape) for k in (0, 1)]
    _, part = connected_components(graph, directed=False)
    branching = np.bincount(part, np.bincount(ends.ravel()) != 2) > 0
    on_side = np.any(np.all(mesh.points[pairs] == 0, axis=1) | np.all(mesh.points[pairs] == size, axis=1), axis=1)
    branching |= np.bincount(part[ends[:, 0]], on_side, len(branching)) > 0
    _, first, number = np.unique(part, return_index=True, return_counts=True)
    for start in first[~branching & (2 * number >= fewest)].tolist():
        order, _ = depth_first_order(graph, start, directed=False)
        hops = np.stack([np.asarray(step[order, np.roll(order, -1)]).ravel() for step in steps], axis=1)
        if np.all(np.abs(hops.sum(axis=0)) < size / 2):
            places = mesh.points[classes[order[0]]] + np.cumsum(hops, axis=0) - hops
            members = np.flatnonzero(part[ends[:, 0]] == part[start])
            place = np.argsort(order)[np.searchsorted(np.sort(order), ends[members])]
            periods = np.round((places[place[:, 0]] - mesh.points[pairs[members, 0]]) / size)
            # A middle node follows the first end of its edge, or the last node if the edge closes the loop.
            between = np.where(np.ptp(place, axis=1) == 1, place.mean(axis=1), len(order))
            along = np.argsort(np.append(np.arange(len(order)), between), kind="stable")
            chain = np.concatenate([places, bends[members] + periods * size])[along]
            chain = chain[~np.isnan(chain[:, 0])]
            distinct, image_number = np.unique(periods, axis=0, return_inverse=True)
            images = [(step * size, members[image_number.ravel() == k]) for k, step in enumerate(distinct)]
            if len(chain) >= fewest:
                yield classes[order], places, chain, images


def _moved(points: Float, places: Float, circle: Ellipses, size: Float) -> Float | None:
    """Move nodes (k, 2), unwrapped at `places`, onto a circle, side nodes along their side; None if one cannot move."""
    centres, radius = circle.centres - np.round((places - points) / size) * size, circle.frames[0, 0, 0]
    spokes = points - centres
    moved: Float = centres + radius * spokes / np.linalg.norm(spokes, axis=1)[:, None]
    on_side = (points == 0) | (points == size)
    if on_side.all(axis=1).any():
        return None
    for axis in (0, 1):
        fixed = np.flatnonzero(on_side[:, axis])
        across = 1 - (spokes[fixed, axis] / radius) ** 2
        # If the circle nearly touches the side, a node along the side cannot reach the circle.
        if np.any(across < 1e-4):
            return None
        moved[fixed, axis] = points[fixed, axis]
        half = np.sign(spokes[fixed, 1 - axis]) * radius * np.sqrt(across)
        moved[fixed, 1 - axis] = centres[fixed, 1 - axis] + half
    return moved


def fit_ellipse(places: Float, tolerance: float = ROUNDNESS_TOLERANCE) -> Ellipses | None:
    """Fit an ellipse to an ordered closed chain of positions (k, 2).

    The conic d.A.d + b.d = 1 of least squares, for offsets d from the mean, is |F^-1 (d - c)| = 1 with the centre c and
    the frame F.  Returns None if the conic is no ellipse, or if `_distance` from the chain exceeds the tolerance.
    """
    mean = places.mean(axis=0)
    scale = np.abs(places - mean).max()
    x, y = ((places - mean) / scale).T
    matrix = np.column_stack([x * x, x * y, y * y, x, y])
    (xx, xy, yy, bx, by), *_ = np.linalg.lstsq(matrix, np.ones(len(x)), rcond=None)
    A = np.array([[xx, xy / 2], [xy / 2, yy]])
    values, axes = np.linalg.eigh(A)
    if values[0] <= np.sqrt(np.finfo(float).eps) * values[1]:  # up to rounding, the conic may be a parabola
        return None
    centre = -np.linalg.solve(A, [bx, by]) / 2
    level = 1 + centre @ A @ centre
    frame = axes * np.sqrt(level / values)
    ellipse = Ellipses((mean + scale * centre)[None], scale * frame[None])
    return ellipse if _distance(ellipse, places) <= tolerance else None


def _distance(ellipse: Ellipses, chain: Float) -> float:
    """Return the largest distance of a closed chain (k, 2) from an ellipse in semi-axes; inf for steps over 60 deg."""
    on_circle = np.linalg.solve(ellipse.frames[0], (chain - ellipse.centres).T)
    chord = np.hypot(*(np.roll(on_circle, -1, axis=1) - on_circle))
    return float(np.abs(np.hypot(*on_circle) - 1).max()) if chord.max() <= 1 else np.inf
