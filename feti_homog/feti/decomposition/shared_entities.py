"""Which subdomains share which coarse vertices and edges: found on rank 0, told to the ranks concerned.

An entity is a vertex class or a torus edge that several subdomains hold.  Each fine node on it, held by k
subdomains, needs k - 1 vector constraints, so rows are numbered by arithmetic and no rank asks another.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from feti_homog.cell.periodic_topology import Torus, edge_pairs, shared_edges
from feti_homog.cell.submesh import Submesh
from feti_homog.typing import Float, Int


@dataclass(frozen=True)
class SharedEntities:
    """The n entities that one rank's subdomains take part in, in the order of their rows.

    Attributes:
        key: (n,) class or torus edge.
        is_edge: (n,) bool.
        nodes: (n,) fine nodes on the entity: 1, or the inner lattice nodes of an edge.
        first_row: (n,) first row in the multiplier vector.
        pointer, sharer: sharers of entity i are sharer[pointer[i]:pointer[i + 1]], sorted by body.
        body: constituent of each sharer.
        fibre: (n,) the fibre that may debond here from the matrix, or -1 where nothing can break.
        normal: (n, 2, 2) unit normals from fibre to matrix at the start and the end of the entity.
        length: (n,) interface length of the edge, or of all edges that meet in the vertex.
        precracked: (n,) whether the mesh has the edge, or all edges that meet in the vertex, debonded.
        owned: (2,) first row of this rank and the one after its last.
        total: number of rows on all ranks.
    """

    key: Int
    is_edge: NDArray[np.bool_]
    nodes: Int
    first_row: Int
    pointer: Int
    sharer: Int
    body: Int
    fibre: Int
    normal: Float
    length: Float
    precracked: NDArray[np.bool_]
    owned: tuple[int, int]
    total: int

    @property
    def copies(self) -> Int:
        """(n,) number of sharers k."""
        return np.diff(self.pointer)


def share(torus: Torus, pieces: Sequence[Submesh], rank: Int, inner: int, n_ranks: int) -> list[SharedEntities]:
    """The tables of all ranks; `rank` (s,) is each subdomain's, `inner` the fine nodes inside a coarse edge."""
    held = [p.class_keys if p.pinned < 0 else np.delete(p.class_keys, p.pinned) for p in pieces]
    kinds = [_sharers(held, pieces)]
    if inner:
        kinds.append(_sharers([p.edge_keys for p in pieces], pieces))
    key, copies, sharer = (np.concatenate(a) for a in zip(*kinds, strict=True))
    is_edge = np.repeat([False, True][: len(kinds)], [len(k[0]) for k in kinds])
    pointer = np.r_[0, np.cumsum(copies)]
    owner = rank[sharer[pointer[1:] - 1]] if len(key) else np.zeros(0, np.int64)
    order = np.argsort(owner, kind="stable")
    sharer = sharer[_ranges(pointer[:-1][order], copies[order])]
    key, copies, is_edge, owner = key[order], copies[order], is_edge[order], owner[order]
    nodes = np.where(is_edge, inner, 1)
    rows = nodes * 2 * (copies - 1)
    ends = np.r_[0, np.cumsum(rows)]
    body = np.array([p.body for p in pieces])[sharer]
    pointer = np.r_[0, np.cumsum(copies)]
    fibre, normal, length, precracked = _interface(torus, key, is_edge, pointer, body)
    limits = ends[np.searchsorted(owner, np.arange(n_ranks + 1))]
    tables = []
    for r in range(n_ranks):
        here = np.zeros(len(key), bool)
        here[np.repeat(np.arange(len(key)), copies)[rank[sharer] == r]] = True
        entries = _ranges(pointer[:-1][here], copies[here])
        tables.append(
            SharedEntities(
                key[here], is_edge[here], nodes[here], ends[:-1][here], np.r_[0, np.cumsum(copies[here])],
                sharer[entries], body[entries], fibre[here], normal[here], length[here],
                precracked[here], (int(limits[r]), int(limits[r + 1])), int(ends[-1]),
            )
        )  # fmt: skip
    return tables


def _sharers(keys: Sequence[Int], pieces: Sequence[Submesh]) -> tuple[Int, Int, Int]:
    """Keys that several pieces hold, how many do, and which: sorted by key, then body, then subdomain."""
    sizes = [len(k) for k in keys]
    key, piece = np.concatenate(keys), np.repeat(np.arange(len(keys)), sizes)
    body = np.repeat([p.body for p in pieces], sizes)
    order = np.lexsort((piece, body, key))
    unique, which, count = np.unique(key[order], return_inverse=True, return_counts=True)
    several = count > 1
    return unique[several], count[several], piece[order][several[which]]


def _ranges(start: Int, count: Int) -> Int:
    """start[0] .. start[0] + count[0] - 1, start[1] .. and so on."""
    ends = np.cumsum(count)
    shift: Int = np.repeat(start - ends + count, count)
    return shift + np.arange(count.sum(), dtype=np.int64)


def _interface(
    torus: Torus, key: Int, is_edge: NDArray[np.bool_], pointer: Int, body: Int
) -> tuple[Int, Float, Float, NDArray[np.bool_]]:
    """Fibre, normals, length and precrack of the entities where exactly one fibre meets the matrix."""
    is_fibre = torus.constituent_phase > 0
    low, high = body[pointer[:-1]], body[pointer[1:] - 1]
    copies = np.diff(pointer)
    inside = (body != np.repeat(low, copies)) & (body != np.repeat(high, copies))
    others = np.bincount(np.repeat(np.arange(len(key)), copies), inside, len(key))
    breakable = (others == 0) & ~is_fibre[low] & is_fibre[high]
    edge, normal, length = _edge_geometry(torus)
    n_edges, n_classes = torus.torus_edge.max() + 1, torus.node_class.max() + 1
    edge_normal, edge_length = np.zeros((n_edges, 2, 2)), np.zeros(n_edges)
    edge_normal[edge], edge_length[edge] = normal, length
    bonded = np.zeros(n_edges, bool)
    bonded[edge] = True
    bonded[torus.torus_edge[torus.plane_edges(torus.mesh.debonded_edges)]] = False
    plane = np.unique(torus.torus_edge, return_index=True)[1]
    ends = torus.node_class[torus.edges[plane]]
    vertex_normal, vertex_length = np.zeros((n_classes, 2)), np.zeros(n_classes)
    for end in range(2):
        np.add.at(vertex_normal, ends[:, end], edge_normal[:, end] * edge_length[:, None])
        np.add.at(vertex_length, ends[:, end], edge_length)
    holding = np.bincount(ends[bonded].ravel(), minlength=n_classes)
    vertex_normal /= np.maximum(np.hypot(*vertex_normal.T), 1e-300)[:, None]
    vertices, edges = key[~is_edge], key[is_edge]
    normals, lengths = np.empty((len(key), 2, 2)), np.empty(len(key))
    normals[~is_edge], normals[is_edge] = vertex_normal[vertices][:, None], edge_normal[edges]
    lengths[~is_edge], lengths[is_edge] = vertex_length[vertices], edge_length[edges]
    precracked = np.empty(len(key), bool)
    precracked[~is_edge], precracked[is_edge] = holding[vertices] == 0, ~bonded[edges]
    return np.where(breakable, high, -1), normals, lengths, precracked & breakable


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
