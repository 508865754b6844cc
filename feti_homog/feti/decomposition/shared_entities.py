"""Which subdomains share which coarse vertices and edges: found on rank 0, and sent to the ranks concerned.

An entity is a vertex class or a torus edge that belongs to several subdomains.  Each fine node on an entity of k
subdomains needs k - 1 vector constraints, so rows are numbered by arithmetic and no rank asks another.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from feti_homog.cell.periodic_topology import Torus, edge_pairs, shared_edges
from feti_homog.cell.submesh import Submesh
from feti_homog.typing import Bool, Float, Int


@dataclass(frozen=True)
class SharedEntities:
    """The n entities that one rank's subdomains take part in, in the order of their rows.

    Attributes:
        key: (n,) class or torus edge.
        is_edge: (n,) bool.
        nodes: (n,) fine nodes on the entity: 1, or the inner lattice nodes of an edge.
        first_row: (n,) first row in the multiplier vector.
        pointer, sharer: the subdomains that share entity i are sharer[pointer[i]:pointer[i + 1]], sorted by body.
        body: constituent of each sharer.
        fibre: (n,) the fibre that may debond here from the matrix, or -1 where nothing can break.
        normal: (n, 2, 2) unit normals from fibre to matrix at the start and the end of the entity.
        length: (n,) interface length of the edge, or of all edges that meet in the vertex.
        precracked: (n,) whether the mesh has the edge, or all edges that meet in the vertex, debonded.
        owned: (2,) first row of this rank and the one after its last.
        global_rows: number of rows on all ranks.
    """

    key: Int
    is_edge: Bool
    nodes: Int
    first_row: Int
    pointer: Int
    sharer: Int
    body: Int
    fibre: Int
    normal: Float
    length: Float
    precracked: Bool
    owned: tuple[int, int]
    global_rows: int

    @property
    def copies(self) -> Int:
        """(n,) number of subdomains k that share each entity."""
        return np.diff(self.pointer)

    def restricted(self, mask: Bool, owned: tuple[int, int]) -> SharedEntities:
        """The entities where `mask` (n,) is true, for a rank that owns the rows from owned[0] up to owned[1]."""
        sharers = _ranges(self.pointer[:-1][mask], self.copies[mask])
        return replace(
            self,
            key=self.key[mask],
            is_edge=self.is_edge[mask],
            nodes=self.nodes[mask],
            first_row=self.first_row[mask],
            pointer=np.r_[0, np.cumsum(self.copies[mask])],
            sharer=self.sharer[sharers],
            body=self.body[sharers],
            fibre=self.fibre[mask],
            normal=self.normal[mask],
            length=self.length[mask],
            precracked=self.precracked[mask],
            owned=owned,
        )


@dataclass(frozen=True)
class _Sharers:
    """The n entities that several subdomains share: their keys, whether they are edges, and who shares them."""

    key: Int
    is_edge: Bool
    pointer: Int
    sharer: Int

    def reordered(self, order: Int) -> _Sharers:
        """The same entities in another order (n,)."""
        copies = np.diff(self.pointer)[order]
        sharer = self.sharer[_ranges(self.pointer[:-1][order], copies)]
        return _Sharers(self.key[order], self.is_edge[order], np.r_[0, np.cumsum(copies)], sharer)


@dataclass(frozen=True)
class _Interface:
    """Fibre, normals, length and precrack of n entities, as in `SharedEntities`."""

    fibre: Int
    normal: Float
    length: Float
    precracked: Bool


def share_entities(
    torus: Torus, submeshes: Sequence[Submesh], rank: Int, nodes_on_edge: int, n_ranks: int
) -> list[SharedEntities]:
    """The shared entities of each rank, in the order of ranks.

    An entity belongs to the rank of its last sharer; rows are numbered rank by rank.

    Args:
        rank: (s,) rank of each submesh.
        nodes_on_edge: fine nodes inside a coarse edge.
    """
    found = _find_sharers(submeshes, edges_have_nodes=nodes_on_edge > 0)
    owner = rank[found.sharer[found.pointer[1:] - 1]] if len(found.key) else np.zeros(0, np.int64)
    order = np.argsort(owner, kind="stable")
    found, owner = found.reordered(order), owner[order]
    copies = np.diff(found.pointer)
    nodes = np.where(found.is_edge, nodes_on_edge, 1)
    ends = np.r_[0, np.cumsum(nodes * 2 * (copies - 1))]
    body = np.array([s.body for s in submeshes])[found.sharer]
    interface = _interface(torus, found, body)
    whole = SharedEntities(
        key=found.key,
        is_edge=found.is_edge,
        nodes=nodes,
        first_row=ends[:-1],
        pointer=found.pointer,
        sharer=found.sharer,
        body=body,
        fibre=interface.fibre,
        normal=interface.normal,
        length=interface.length,
        precracked=interface.precracked,
        owned=(0, int(ends[-1])),
        global_rows=int(ends[-1]),
    )
    limits = ends[np.searchsorted(owner, np.arange(n_ranks + 1))].tolist()
    entity = np.repeat(np.arange(len(found.key)), copies)
    shares = []
    for r in range(n_ranks):
        takes_part = np.zeros(len(found.key), bool)
        takes_part[entity[rank[found.sharer] == r]] = True
        shares.append(whole.restricted(takes_part, (limits[r], limits[r + 1])))
    return shares


def _find_sharers(submeshes: Sequence[Submesh], edges_have_nodes: bool) -> _Sharers:
    """The vertex classes, but for the pinned one, and the edges that several submeshes share."""
    classes = [s.class_keys if s.pinned < 0 else np.delete(s.class_keys, s.pinned) for s in submeshes]
    kinds = [_several(classes, submeshes)]
    if edges_have_nodes:
        kinds.append(_several([s.edge_keys for s in submeshes], submeshes))
    key, copies, sharer = (np.concatenate(a) for a in zip(*kinds, strict=True))
    is_edge = np.repeat([False, True][: len(kinds)], [len(k[0]) for k in kinds])
    return _Sharers(key, is_edge, np.r_[0, np.cumsum(copies)], sharer)


def _several(keys: Sequence[Int], submeshes: Sequence[Submesh]) -> tuple[Int, Int, Int]:
    """Keys that several submeshes have, how many, and which: sorted by key, then body, then subdomain."""
    sizes = [len(k) for k in keys]
    key, subdomain = np.concatenate(keys), np.repeat(np.arange(len(keys)), sizes)
    body = np.repeat([s.body for s in submeshes], sizes)
    order = np.lexsort((subdomain, body, key))
    unique, which, count = np.unique(key[order], return_inverse=True, return_counts=True)
    several = count > 1
    return unique[several], count[several], subdomain[order][several[which]]


def _ranges(start: Int, count: Int) -> Int:
    """start[0] .. start[0] + count[0] - 1, start[1] .. and so on."""
    ends = np.cumsum(count)
    shift: Int = np.repeat(start - ends + count, count)
    return shift + np.arange(count.sum(), dtype=np.int64)


def _interface(torus: Torus, found: _Sharers, body: Int) -> _Interface:
    """Geometry of the entities where exactly one fibre meets the matrix; `body` is that of each sharer."""
    key, is_edge = found.key, found.is_edge
    fibre = _breakable_fibre(torus, found.pointer, body)
    edge, normal, length = _edge_geometry(torus)
    n_edges, n_classes = torus.torus_edge.max() + 1, torus.node_class.max() + 1
    edge_normal, edge_length = np.zeros((n_edges, 2, 2)), np.zeros(n_edges)
    edge_normal[edge], edge_length[edge] = normal, length
    bonded = np.zeros(n_edges, bool)
    bonded[edge] = True
    bonded[torus.torus_edge[torus.plane_edges(torus.mesh.debonded_edges)]] = False
    ends = torus.node_class[torus.edges[np.unique(torus.torus_edge, return_index=True)[1]]]
    vertex_normal, vertex_length = np.zeros((n_classes, 2)), np.zeros(n_classes)
    for end in range(2):
        np.add.at(vertex_normal, ends[:, end], edge_normal[:, end] * edge_length[:, None])
        np.add.at(vertex_length, ends[:, end], edge_length)
    vertex_normal /= np.maximum(np.hypot(*vertex_normal.T), 1e-300)[:, None]
    bonded_edges_at = np.bincount(ends[bonded].ravel(), minlength=n_classes)
    vertices, edges = key[~is_edge], key[is_edge]
    normals, lengths = np.empty((len(key), 2, 2)), np.empty(len(key))
    normals[~is_edge], normals[is_edge] = vertex_normal[vertices][:, None], edge_normal[edges]
    lengths[~is_edge], lengths[is_edge] = vertex_length[vertices], edge_length[edges]
    precracked = np.empty(len(key), bool)
    precracked[~is_edge], precracked[is_edge] = bonded_edges_at[vertices] == 0, ~bonded[edges]
    return _Interface(fibre, normals, lengths, precracked & (fibre >= 0))


def _breakable_fibre(torus: Torus, pointer: Int, body: Int) -> Int:
    """(n,) the fibre of the entities where one fibre and the matrix meet and no third body, else -1."""
    is_fibre = torus.constituent_phase > 0
    low, high = body[pointer[:-1]], body[pointer[1:] - 1]
    copies = np.diff(pointer)
    third = (body != np.repeat(low, copies)) & (body != np.repeat(high, copies))
    thirds = np.bincount(np.repeat(np.arange(len(copies)), copies), third, len(copies))
    return np.where((thirds == 0) & ~is_fibre[low] & is_fibre[high], high, -1)


def _edge_geometry(torus: Torus) -> tuple[Int, Float, Float]:
    """Torus edges between a fibre and the matrix, their normals at start and end, and their (arc) lengths."""
    mesh, is_fibre = torus.mesh, torus.constituent_phase > 0
    left, right = edge_pairs(torus.triangle_torus_edges)
    mixed = is_fibre[torus.constituent[left]] != is_fibre[torus.constituent[right]]
    fibre = np.where(is_fibre[torus.constituent[left]], left, right)[mixed]
    edge = shared_edges(torus.triangle_torus_edges)[mixed]
    k = np.argmax(torus.triangle_torus_edges[fibre] == edge[:, None], axis=1)
    start, end = mesh.triangles[fibre, k], mesh.triangles[fibre, (k + 1) % 3]
    plane = torus.triangle_edges[fibre, k]
    backwards = torus.edges[plane, 0] != start
    a, b = mesh.points[start], mesh.points[end]
    chord = np.hypot(*(b - a).T)
    outward = np.stack([b[:, 1] - a[:, 1], a[:, 0] - b[:, 0]], axis=1) / chord[:, None]
    circle = torus.edge_circles[plane]
    curved = circle[:, 2] > 0
    radius = circle[curved, 2]
    length = chord.copy()
    length[curved] = 2 * radius * np.arcsin(chord[curved] / (2 * radius))
    normal = np.stack([outward, outward], axis=1)
    radial = np.stack([a, b], axis=1)[curved] - circle[curved, None, :2]
    side = np.sign((radial.sum(axis=1) * outward[curved]).sum(axis=1))
    normal[curved] = side[:, None, None] * radial / circle[curved, 2, None, None]
    normal[backwards] = normal[backwards, ::-1]
    return edge, normal, length
