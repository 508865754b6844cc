"""Find fibres in a mesh: numbers, centres, radii, semi-axes, coating thickness, unwrapped positions on the torus.

Directions on interfaces are angles about the centres.
"""

import numpy as np

from feti_homog.mesh.coarse_mesh import areas, twins
from feti_homog.mesh.periodic_topology import Torus, components, edge_pairs
from feti_homog.mesh.submeshes import Submesh, cut_bodies
from feti_homog.microstructure import phase_names
from feti_homog.typing import Bool, Float, Int

# Limits, relative to the longer semi-axis: distance between the centres of nested curves, and difference between the
# thicknesses of a coating along both semi-axes.
SAME_CENTRE, SAME_LENGTH = 1e-9, 1e-6
# Least angle in degrees at a corner: smaller angles are between the chords of a curve, or of rounded coordinates.
LEAST_CORNER = 15.0


def unwrap(submesh: Submesh) -> tuple[Float, bool]:
    """Unwrap a connected submesh from the torus by a walk through the triangles.

    The submesh is contractible if every class has a unique unwrapped position. Only a contractible submesh can rotate;
    a submesh that winds around the torus cannot.

    Returns:
        Shifts (t, 2) of the triangles by whole periods, and whether the submesh is contractible.
    """
    if len(submesh.class_keys) == len(submesh.points):
        # No two vertices are images of each other: the plane positions are unwrapped.
        return np.zeros((len(submesh.triangles), 2)), True
    part = components(len(submesh.triangles), *edge_pairs(submesh.triangle_edges))
    # The shift of each plane-connected part, along a spanning tree of contacts across the cell boundary.
    part_of_edge = np.empty(len(submesh.edges), np.int64)
    part_of_edge[submesh.triangle_edges] = part[:, None]
    a, b = twins(submesh.edge_class)
    step = submesh.points[submesh.edges[a, 0]] - submesh.points[submesh.edges[b, 0]]
    links, first = np.unique(np.stack([part_of_edge[a], part_of_edge[b]], axis=1), axis=0, return_index=True)
    neighbours: dict[int, list[tuple[int, Float]]] = {k: [] for k in range(part.max() + 1)}
    for (p, q), k in zip(links.tolist(), first, strict=True):
        neighbours[p].append((q, step[k]))
        neighbours[q].append((p, -step[k]))
    shifts = np.full((part.max() + 1, 2), np.nan)
    shifts[0] = 0.0
    queue = [0]
    for p in queue:
        for q, jump in neighbours[p]:
            if np.isnan(shifts[q, 0]):
                shifts[q] = np.round((shifts[p] + jump) / submesh.period) * submesh.period
                queue.append(q)
    shift = shifts[part]
    corners = submesh.points[submesh.triangles] + shift[:, None]
    classes = submesh.vertex_class[submesh.triangles].ravel()
    position = np.empty((len(submesh.class_keys), 2))
    position[classes] = corners.reshape(-1, 2)
    closes = np.allclose(position[classes], corners.reshape(-1, 2), atol=1e-6 * submesh.period.min())
    return shift, closes


def fibre_circles(torus: Torus) -> Float:
    """Return centre and radius (constituents, 3) of each fibre's outer circle, in any periodic image.

    Fibres that are not round have the radius NaN, and the centre in `CoarseMesh.centres` or else the area centroid. The
    centroid is NaN for fibres that wind around the torus. The matrix has the centre and radius NaN.
    """
    bodies, edge, is_round = _outer_edges(torus)
    circles = np.full((len(torus.constituent_phase), 3), np.nan)
    circles[bodies[is_round]] = torus.edge_circles[edge[is_round]]
    mesh, n = torus.mesh, len(circles)
    has_images = (mesh.representative[mesh.triangles] != mesh.triangles).any(axis=1)
    reaches_side = np.bincount(torus.constituent, has_images, n) > 0
    not_round = np.isnan(circles[:, 2]) & (torus.constituent_phase > 0)
    inside = np.flatnonzero((not_round & ~reaches_side)[torus.constituent])
    triangles, body = mesh.triangles[inside], torus.constituent[inside]
    weights, middles = areas(mesh.points, triangles), sum(mesh.points[k] for k in triangles.T) / triangles.shape[1]
    area, moments = np.bincount(body, weights, n), np.array([np.bincount(body, weights * x, n) for x in middles.T])
    circles[area > 0, :2] = (moments[:, area > 0] / area[area > 0]).T
    for submesh in cut_bodies(torus, np.flatnonzero((not_round & reaches_side)[torus.constituent])):
        shift, closes = unwrap(submesh)
        if closes:
            middles = submesh.points[submesh.triangles].mean(axis=1) + shift
            weights = areas(submesh.points, submesh.triangles.astype(np.int32))
            circles[submesh.body, :2] = np.average(middles, axis=0, weights=weights)
    if torus.mesh.centres is not None:
        body, first = np.unique(torus.constituent, return_index=True)
        number = torus.mesh.precedence[first]
        listed = np.isnan(circles[body, 2]) & (number > 0)
        circles[body[listed], :2] = torus.mesh.centres[(number[listed] - 1) % len(torus.mesh.centres)]
    return circles


def fibre_frames(torus: Torus) -> Float:
    """Return the frame F (constituents, 2, 2) of each fibre's outer ellipse, with centre c and points c + F p, |p| = 1.

    The frame is NaN for the matrix, and for fibres with a boundary that is not on concentric ellipses.
    """
    bodies, edge, _ = _outer_edges(torus)
    frames = np.full((len(torus.constituent_phase), 2, 2), np.nan)
    if len(bodies):
        frames[bodies] = torus.edge_ellipses.frames[edge]
    return frames


def corner_edges(torus: Torus) -> int:
    """Return the most straight edges between phases, or beside voids, at a corner (above LEAST_CORNER); 0 without."""
    is_straight = torus.is_outline
    is_straight[torus.torus_edge[torus.arcs]] = False
    ends = torus.low_copies(is_straight)
    along = np.diff(torus.mesh.points[ends], axis=1)[:, 0]
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    nodes, node, counts = np.unique(torus.node_class[ends], return_inverse=True, return_counts=True)
    # Of two unit vectors from a node, the sum has the length 2 sin(angle / 2).
    sums = np.array([np.bincount(node.ravel(), np.stack([x, -x], axis=1).ravel(), len(nodes)) for x in along.T])
    angles = np.where(counts == 2, np.linalg.norm(sums, axis=0), 0.0)
    return int(counts[(counts > 2) | (angles > 2.0 * np.sin(np.radians(LEAST_CORNER / 2.0)))].max(initial=0))


def _outer_edges(torus: Torus) -> tuple[Int, Int, Bool]:
    """Find the fibres (k,) that lie inside an ellipse and whose other boundaries are smaller, concentric ellipses.

    Also returns, for each of these fibres, a plane edge (k,) on the largest ellipse, and the mask (k,) of round fibres.
    """
    if not len(torus.mesh.ellipses):
        return np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0, bool)
    triangle, k = np.nonzero(torus.is_outline[torus.triangle_torus_edges])
    edge, body, ellipses = torus.triangle_edges[triangle, k], torus.constituent[triangle], torus.edge_ellipses
    area = np.abs(np.linalg.det(ellipses.frames))
    order = np.lexsort((edge, -area[edge], body))
    edge = edge[order]
    bodies, first, place = np.unique(body[order], return_index=True, return_inverse=True)
    triangle, k = triangle[order][first], k[order][first]
    outer, period = ellipses[edge[first]], torus.mesh.period
    offset = (ellipses.centres[edge] - outer.centres[place] + period / 2) % period - period / 2
    is_off_centre = (area[edge] == 0) | (np.linalg.norm(offset, axis=1) > SAME_CENTRE * outer.longest[place])
    is_round = np.bincount(place, np.isnan(torus.edge_circles[edge, 2]), len(bodies)) == 0
    is_concentric = (np.bincount(place, is_off_centre, len(bodies)) == 0) & (torus.constituent_phase[bodies] > 0)
    start, stop = (torus.mesh.points[torus.mesh.triangles[triangle, (k + step) % 3]] for step in (0, 1))
    to_centre = (outer.centres - start + period / 2) % period - period / 2
    is_concentric &= np.linalg.det(np.stack([stop - start, to_centre], axis=1)) > 0
    return bodies[is_concentric], edge[first][is_concentric], is_round[is_concentric]


def fibre_numbers(torus: Torus) -> tuple[Int, Bool]:
    """Return the numbers (constituents,) of fibres and coatings, and the mask (constituents,) of fibres.

    Fibre numbers begin at 1; the matrix has 0. A coating has the lowest number of the fibres that it touches; a coating
    without fibres counts as a fibre.
    """
    phase, n = torus.constituent_phase, len(torus.constituent_phase)
    coats = np.array([name == phase_names.COATING for name in torus.mesh.phases])[phase]
    one, other = (torus.constituent[side] for side in torus.sides[:2])
    sides = np.stack([one, other])[:, one != other]
    coating, core = np.hstack([sides, sides[::-1]])
    inside = coats[coating] & ~coats[core] & (phase[core] > 0)
    is_coating = np.zeros(n, bool)
    is_coating[coating[inside]] = True
    is_fibre = (phase > 0) & ~is_coating
    number = np.where(is_fibre, np.cumsum(is_fibre), n)
    np.minimum.at(number, coating[inside], number[core[inside]])
    return np.where(phase > 0, number, 0), is_fibre


def coating_thickness(numbers: Int, is_fibre: Bool, semi_axes: Float) -> Float:
    """Return the coating thickness (fibres,), 0 for fibres without a coating.

    `numbers` and `is_fibre` come from `fibre_numbers`; `semi_axes` is (constituents, 2). The thickness is the
    difference between semi-axes of coating and fibre: NaN without semi-axes, or if both axes give different
    thicknesses.
    """
    coats, fibres = np.flatnonzero((numbers > 0) & ~is_fibre), np.flatnonzero(is_fibre)
    thickness, coated = np.zeros(len(fibres)), numbers[coats] - 1
    outer, inner = np.sort(semi_axes[coats], axis=1), np.sort(semi_axes[fibres[coated]], axis=1)
    low, high = (outer - inner).T
    thickness[coated] = np.where(np.abs(high - low) <= SAME_LENGTH * outer[:, 1], low, np.nan)
    return thickness
