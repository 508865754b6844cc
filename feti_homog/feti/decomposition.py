"""Who gets what: constituents -> subdomains -> ranks, decided on rank 0 from the coarse mesh."""

from __future__ import annotations

import heapq
from dataclasses import dataclass

import numpy as np
import pymetis
from numpy.typing import NDArray
from scipy.sparse import coo_matrix

from feti_homog.cell.torus import Torus, components, edge_pairs

Int = NDArray[np.int64]


@dataclass(frozen=True)
class Decomposition:
    """Subdomain of each coarse triangle, (m,), and rank of each subdomain, (s,)."""

    subdomain: Int
    rank: Int


def decompose(torus: Torus, parts: Int, pieces: Int, n_ranks: int) -> Decomposition:
    """Cut the bodies into pieces and deal them out.

    Args:
        parts: (m,) body of each triangle: `torus.constituent`, or `torus.plane_parts()`.
        pieces: (b,) wanted pieces of each body; METIS cuts a body that has more than one.
        n_ranks: ranks to share the subdomains; some get none if there are more ranks than subdomains.

    Every subdomain is connected through edges: pieces that METIS leaves in several parts are split.
    """
    left, right = edge_pairs(torus.triangle_torus_edges)
    inside = parts[left] == parts[right]
    left, right = left[inside], right[inside]
    piece = np.zeros(len(parts), np.int64)
    for body in np.flatnonzero(pieces > 1):
        piece[parts == body] = _metis(parts == body, left, right, int(pieces[body]))
    key = parts * (piece.max() + 1) + piece
    together = key[left] == key[right]
    connected = components(len(parts), left[together], right[together])
    # Numbered body by body, so that neighbours in number are neighbours in place.
    order = np.lexsort((connected, piece, parts))
    first = np.unique(connected[order], return_index=True)[1]
    number = np.empty_like(first)
    number[np.argsort(first)] = np.arange(len(first))
    subdomain = number[connected]
    return Decomposition(subdomain, _deal(np.bincount(subdomain), n_ranks))


def pieces_for_count(load: Int, wanted: int) -> Int:
    """(b,) pieces of each body: `wanted` in all (never fewer than one a body), the largest pieces halved first."""
    pieces = np.ones(len(load), np.int64)
    heap = [(-float(size), body) for body, size in enumerate(load)]
    heapq.heapify(heap)
    for _ in range(wanted - len(load)):
        body = heap[0][1]
        if pieces[body] >= load[body]:
            break
        pieces[body] += 1
        heapq.heapreplace(heap, (-load[body] / pieces[body], body))
    return pieces


def pieces_for_size(load: Int, dofs_per_load: float, max_dofs: int) -> Int:
    """(b,) pieces of each body such that none has many more than `max_dofs` degrees of freedom."""
    return np.minimum(np.ceil(load * dofs_per_load / max_dofs).astype(np.int64), load)


def _metis(mask: NDArray[np.bool_], left: Int, right: Int, count: int) -> Int:
    """Part of each masked triangle, cut through the edges (left, right)."""
    number = np.cumsum(mask) - 1
    own = mask[left]
    a, b = number[left[own]], number[right[own]]
    n = int(mask.sum())
    # Two triangles that share two edges (on a very coarse torus) count once.
    graph = coo_matrix((np.ones(2 * len(a), np.int8), (np.r_[a, b], np.r_[b, a])), shape=(n, n)).tocsr()
    options = pymetis.Options(contig=1, seed=0)
    _, part = pymetis.part_graph(count, pymetis.CSRAdjacency(graph.indptr, graph.indices), options=options)
    return np.asarray(part, np.int64)


def _deal(load: Int, n_ranks: int) -> Int:
    """Rank of each subdomain: the largest goes first, each to the least loaded rank."""
    ranks = np.zeros(len(load), np.int64)
    heap = [(0, rank) for rank in range(n_ranks)]
    for subdomain in np.argsort(-load, kind="stable"):
        total, rank = heap[0]
        ranks[subdomain] = rank
        heapq.heapreplace(heap, (total + int(load[subdomain]), rank))
    return ranks
