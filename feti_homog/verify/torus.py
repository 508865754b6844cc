"""Places of a torn mesh on the periodic cell: nodes and sides at one place, and the bodies that meet there."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import connected_components, dijkstra
from scipy.spatial import cKDTree

from feti_homog.typing import Bool, Float, Int
from feti_homog.verify.reading import COATING, Mesh

# Points nearer than this share of the shortest side are at one place.
SAME_PLACE = 1e-2


@dataclass(frozen=True)
class TornSides:
    """The s sides with one element in their subdomain: on cuts, interfaces and the cell boundary.

    Attributes:
        element: (s,) elements.
        nodes: (s, 2 or 3) ends and middle nodes.
        normal: (s, 2) outward normals times chord lengths.
        partner: (s,) the side at the same place of the torus, -1 unless there is exactly one.
        at_void: (s,) True where there is none.
    """

    element: Int
    nodes: Int
    normal: Float
    partner: Int
    at_void: Bool


@dataclass(frozen=True)
class TornNodes:
    """The b nodes on torn sides: mesh numbers, numbers of places on the torus, subdomains, phases (b,)."""

    node: Int
    place: Int
    subdomain: Int
    phase: Int

    @property
    def places(self) -> int:
        """Number of places."""
        return int(self.place.max(initial=-1)) + 1


def torn(mesh: Mesh, size: Float) -> tuple[TornSides, TornNodes, float]:
    """Return torn sides and nodes on the torus of a size (2,), and the radius of a place."""
    m, columns = mesh.triangles.shape
    local = [(side, (side + 1) % 3, 3 + side)[: columns // 3 + 1] for side in range(3)]
    every = mesh.triangles[:, local].reshape(3 * m, -1)
    low, high = np.sort(every[:, :2], axis=1).T
    _, first, count = np.unique(low * len(mesh.points) + high, return_index=True, return_counts=True)
    once = np.sort(first[count == 1])  # nodes are those of one subdomain
    element, nodes = once // 3, every[once]
    ends = mesh.points[nodes[:, :2]]
    chord = ends[:, 1] - ends[:, 0]
    normal = np.stack([chord[:, 1], -chord[:, 0]], axis=1)
    radius = SAME_PLACE * float(np.hypot(*normal.T).min(initial=float(size.min())))
    side_place = same_places(ends.mean(axis=1), size, radius)
    order, sharers = np.argsort(side_place, kind="stable"), np.bincount(side_place, minlength=1)
    pairs = (np.cumsum(sharers) - sharers)[sharers == 2]
    partner = np.full(len(side_place), -1)
    partner[order[pairs]], partner[order[pairs + 1]] = order[pairs + 1], order[pairs]
    sides = TornSides(element, nodes, normal, partner, np.asarray(sharers[side_place] == 1))
    number, first = np.unique(nodes, return_index=True)
    owner = element[first // nodes.shape[1]]
    place = same_places(mesh.points[number], size, radius)
    return sides, TornNodes(number, place, np.asarray(mesh.subdomain[owner]), np.asarray(mesh.phase[owner])), radius


def wrapped(points: Float, size: Float) -> Float:
    """Points (k, 2) with coordinates from 0 up to, not at, the size."""
    inside = points - np.floor(points / size) * size
    return np.asarray(np.where(inside >= size, 0.0, inside))


def from_centre(points: Float, centres: Float, size: Float) -> Float:
    """Return the vectors (k, 2) from the nearest images of centres to points."""
    away = points - centres
    return np.asarray(away - np.round(away / size) * size)


def same_places(points: Float, size: Float, radius: float) -> Int:
    """(k,) place numbers of points (k, 2), equal within `radius` on the torus."""
    if not len(points):
        return np.zeros(0, np.int64)
    pairs = cKDTree(wrapped(points, size), boxsize=size).query_pairs(radius, output_type="ndarray")
    graph = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(points),) * 2)
    return np.asarray(connected_components(graph, directed=False)[1], np.int64)


def along_one_line(sides: TornSides, nodes: TornNodes, part: Int) -> Bool:
    """(places,) True where two bodies meet along one line; `part` (m,) is the body of each element.

    Each body ends at two sides of such a place, not all at voids.  A middle node is on one line.
    """
    apart = ~sides.at_void & (part[sides.element] != part[sides.element[sides.partner]])
    place = np.full(int(nodes.node.max(initial=-1)) + 1, -1)
    place[nodes.node] = nodes.place
    facing, at_void, middle = (
        np.bincount(place[side_nodes].ravel(), minlength=nodes.places)
        for side_nodes in (sides.nodes[apart, :2], sides.nodes[sides.at_void, :2], sides.nodes[:, 2:])
    )
    return np.asarray((middle > 0) | ((facing + at_void == 4) & (facing > 0)))


def bodies(mesh: Mesh, phases: tuple[str, ...], sides: TornSides) -> tuple[Int, Int]:
    """Return the part (subdomains,) of each subdomain, and the rank (parts,) of each part, larger inwards.

    A part is a connected region of one phase on the torus. Ranks go by the parts between it and the matrix, then
    coatings before others, then labels.
    """
    paired = np.flatnonzero(sides.partner >= 0)
    ends = np.stack([sides.element[paired], sides.element[sides.partner[paired]]])
    links = mesh.subdomain[ends[:, mesh.phase[ends[0]] == mesh.phase[ends[1]]]]
    graph = coo_matrix((np.ones(links.shape[1]), tuple(links)), shape=(int(mesh.subdomain.max()) + 1,) * 2)
    n, part = connected_components(graph, directed=False)
    of_element = part[mesh.subdomain]
    phase, label = np.zeros(n, np.int64), np.zeros(n, np.int64)
    phase[of_element], label[of_element] = mesh.phase, mesh.body
    graph = csr_matrix((np.ones(len(paired)), tuple(of_element[ends])), shape=(n, n))
    steps = dijkstra(graph, directed=False, indices=np.flatnonzero(phase == 0), unweighted=True, min_only=True)
    coats = np.array([name == COATING for name in phases])[phase]
    rank = np.empty(n, np.int64)
    rank[np.lexsort((label, ~coats, steps))] = np.arange(n)
    return np.asarray(part, np.int64), rank
