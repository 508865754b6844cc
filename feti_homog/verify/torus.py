"""Find torn nodes and sides at places on the torus of the periodic cell, and the bodies that meet there.

The `shift` (2,) between images is the size of a periodic cell; None for other conditions on the sides.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import connected_components, dijkstra
from scipy.spatial import cKDTree

from feti_homog.typing import Bool, Float, Int
from feti_homog.verify.reading import COATING, Mesh

# Distance below which points are at one place, relative to the shortest side.
SAME_PLACE = 1e-2


@dataclass(frozen=True)
class TornSides:
    """The s torn sides, on cuts, interfaces and the cell boundary.  Each has one element in its subdomain.

    Attributes:
        element: (s,) element of a side.
        nodes: (s, 2 or 3) both ends, and the middle node if any.
        normal: (s, 2) outward normal times chord length.
        partner: (s,) other side at the same place of the torus; -1 if none or several.
        alone: (s,) whether a side has no other side at its place.
        on_side: (s,) whether an `alone` side lies on the boundary of a non-periodic cell; others are at voids.
    """

    element: Int
    nodes: Int
    normal: Float
    partner: Int
    alone: Bool
    on_side: Bool

    @property
    def at_void(self) -> Bool:
        """Return whether a side (s,) bounds a void."""
        return self.alone & ~self.on_side


@dataclass(frozen=True)
class TornNodes:
    """The b nodes on torn sides: numbers in the mesh, places on the torus, subdomains and phases, all (b,)."""

    node: Int
    place: Int
    subdomain: Int
    phase: Int

    @property
    def places(self) -> int:
        """Return the number of places."""
        return int(self.place.max(initial=-1)) + 1


def torn(mesh: Mesh, size: Float, shift: Float | None) -> tuple[TornSides, TornNodes, float]:
    """Find torn sides and nodes on the torus of a cell with `size` (2,).  Returns them and the matching radius."""
    m, columns = mesh.triangles.shape
    local = [(side, (side + 1) % 3, 3 + side)[: columns // 3 + 1] for side in range(3)]
    sides_of_elements = mesh.triangles[:, local].reshape(3 * m, -1)
    low, high = np.sort(sides_of_elements[:, :2], axis=1).T
    _, first, count = np.unique(low * len(mesh.points) + high, return_index=True, return_counts=True)
    single = np.sort(first[count == 1])  # subdomains have no node in common
    element, nodes = single // 3, sides_of_elements[single]
    ends = mesh.points[nodes[:, :2]]
    chord = ends[:, 1] - ends[:, 0]
    normal = np.stack([chord[:, 1], -chord[:, 0]], axis=1)
    radius = SAME_PLACE * float(np.hypot(*normal.T).min(initial=float(size.min())))
    side_place = same_places(ends.mean(axis=1), shift, radius)
    order, sharers = np.argsort(side_place, kind="stable"), np.bincount(side_place, minlength=1)
    pairs = (np.cumsum(sharers) - sharers)[sharers == 2]
    partner = np.full(len(side_place), -1)
    partner[order[pairs]], partner[order[pairs + 1]] = order[pairs + 1], order[pairs]
    alone, corner = np.asarray(sharers[side_place] == 1), mesh.points.min(axis=0)
    on_level = [(np.abs(ends - level) < radius).all(axis=1) for level in (corner, corner + size)]
    on_side = alone & np.any(on_level, axis=(0, 2)) & (shift is None)
    sides = TornSides(element, nodes, normal, partner, alone, np.asarray(on_side))
    number, first = np.unique(nodes, return_index=True)
    owner = element[first // nodes.shape[1]]
    place = same_places(mesh.points[number], shift, radius)
    return sides, TornNodes(number, place, np.asarray(mesh.subdomain[owner]), np.asarray(mesh.phase[owner])), radius


def wrapped(points: Float, shift: Float | None) -> Float:
    """Shift points (k, 2) by periods to coordinates in [0, shift).  Without a shift they stay."""
    if shift is None:
        return points
    inside = points - np.floor(points / shift) * shift
    return np.asarray(np.where(inside >= shift, 0.0, inside))


def from_centre(points: Float, centres: Float, shift: Float | None) -> Float:
    """Compute vectors (k, 2) from the nearest periodic images of centres to points."""
    difference = points - centres
    return np.asarray(difference if shift is None else difference - np.round(difference / shift) * shift)


def same_places(points: Float, shift: Float | None, radius: float) -> Int:
    """Assign place numbers (k,) to points (k, 2), equal within `radius` on the torus."""
    if not len(points):
        return np.zeros(0, np.int64)
    pairs = cKDTree(wrapped(points, shift), boxsize=shift).query_pairs(radius, output_type="ndarray")
    graph = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(points),) * 2)
    return np.asarray(connected_components(graph, directed=False)[1], np.int64)


def along_one_line(sides: TornSides, nodes: TornNodes, part: Int) -> Bool:
    """Return whether two bodies meet along one line at places (places,).

    `part` (m,) is the body of an element.  Such places have four ends of sides, not all `alone`, or a middle node.
    """
    apart = ~sides.alone & (part[sides.element] != part[sides.element[sides.partner]])
    place = np.full(int(nodes.node.max(initial=-1)) + 1, -1)
    place[nodes.node] = nodes.place
    groups = sides.nodes[apart, :2], sides.nodes[sides.alone, :2], sides.nodes[:, 2:]
    facing, alone, middle = (np.bincount(place[group].ravel(), minlength=nodes.places) for group in groups)
    return np.asarray((middle > 0) | ((facing + alone == 4) & (facing > 0)))


def bodies(mesh: Mesh, phases: tuple[str, ...], sides: TornSides) -> tuple[Int, Int]:
    """Return the part (subdomains,) of each subdomain and the order (parts,) from the matrix inwards.

    A part is a connected region of one phase on the torus.  The order is by the number of parts between a part and the
    matrix, then coatings before other phases, then by body labels.
    """
    paired = np.flatnonzero(sides.partner >= 0)
    ends = np.stack([sides.element[paired], sides.element[sides.partner[paired]]])
    links = mesh.subdomain[ends[:, mesh.phase[ends[0]] == mesh.phase[ends[1]]]]
    graph = coo_matrix((np.ones(links.shape[1]), tuple(links)), shape=(int(mesh.subdomain.max()) + 1,) * 2)
    n, part = connected_components(graph, directed=False)
    element_part = part[mesh.subdomain]
    phase, label = np.zeros(n, np.int64), np.zeros(n, np.int64)
    phase[element_part], label[element_part] = mesh.phase, mesh.body
    graph = csr_matrix((np.ones(len(paired)), tuple(element_part[ends])), shape=(n, n))
    steps = dijkstra(graph, directed=False, indices=np.flatnonzero(phase == 0), unweighted=True, min_only=True)
    coats = np.array([name == COATING for name in phases])[phase]
    rank = np.empty(n, np.int64)
    rank[np.lexsort((label, ~coats, steps))] = np.arange(n)
    return np.asarray(part, np.int64), rank
