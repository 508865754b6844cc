"""Nodes and sides of a torn mesh that are the same place of the periodic cell."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from feti_homog.typing import Bool, Float, Int
from feti_homog.verify.cell_tables import Mesh
from feti_homog.verify.elements import SIDES

# Places nearer than this share of the shortest side are one.
SAME_PLACE = 1e-2


@dataclass(frozen=True)
class TornSides:
    """The s sides that only one element of its subdomain has: on cuts, interfaces and the boundary of the cell.

    Elements (s,), ends and middle nodes (s, 2 or 3), outward normals times the length of the chord (s, 2), the side at
    the same place of the torus, -1 if there is not exactly one (s,), and whether there is none (s,).
    """

    element: Int
    nodes: Int
    normal: Float
    partner: Int
    at_void: Bool

    @property
    def mismatch(self) -> Float:
        """(s,) |normal + partner's normal| / |normal|, infinite for several partners, 0 at voids."""
        sums = np.hypot(*(self.normal + self.normal[self.partner]).T) / np.hypot(*self.normal.T)
        return np.asarray(np.where(self.at_void, 0.0, np.where(self.partner < 0, np.inf, sums)))


@dataclass(frozen=True)
class TornNodes:
    """The b nodes on torn sides: numbers in the mesh and of their places on the torus, subdomains and phases (b,)."""

    node: Int
    place: Int
    subdomain: Int
    phase: Int

    @property
    def places(self) -> int:
        """Number of places."""
        return int(self.place.max(initial=-1)) + 1


def torn(mesh: Mesh, size: Float) -> tuple[TornSides, TornNodes, float]:
    """Return the torn sides and nodes of a mesh on the torus of a size (2,), and how near the same places are."""
    m, columns = mesh.triangles.shape
    local = [(*side, 3 + number)[: columns // 3 + 1] for number, side in enumerate(SIDES)]
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


def same_places(points: Float, size: Float, radius: float) -> Int:
    """(k,) numbers of the places of points (k, 2): those within `radius` of each other on the torus have the same."""
    if not len(points):
        return np.zeros(0, np.int64)
    pairs = cKDTree(wrapped(points, size), boxsize=size).query_pairs(radius, output_type="ndarray")
    graph = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(points),) * 2)
    return np.asarray(connected_components(graph, directed=False)[1], np.int64)


def along_one_line(sides: TornSides, nodes: TornNodes, part: Int) -> Bool:
    """(places,) whether two bodies meet there along one line, if two do; `part` (m,) is the body of each element.

    Then either body ends there at two sides, and not all of these are at voids.  A middle node is on one line.
    """
    apart = ~sides.at_void & (part[sides.element] != part[sides.element[sides.partner]])
    place = np.full(int(nodes.node.max(initial=-1)) + 1, -1)
    place[nodes.node] = nodes.place
    facing, at_void, middle = (
        np.bincount(place[own].ravel(), minlength=nodes.places)
        for own in (sides.nodes[apart, :2], sides.nodes[sides.at_void, :2], sides.nodes[:, 2:])
    )
    return np.asarray((middle > 0) | ((facing + at_void == 4) & (facing > 0)))


def constituents(mesh: Mesh, sides: TornSides) -> Int:
    """(subdomains,) number of the connected part of a phase on the torus that each subdomain lies in."""
    paired = np.flatnonzero(sides.partner >= 0)
    a, b = sides.element[paired], sides.element[sides.partner[paired]]
    joined = mesh.phase[a] == mesh.phase[b]
    n = int(mesh.subdomain.max()) + 1
    links = (mesh.subdomain[a[joined]], mesh.subdomain[b[joined]])
    graph = coo_matrix((np.ones(len(links[0])), links), shape=(n, n))
    return np.asarray(connected_components(graph, directed=False)[1], np.int64)
