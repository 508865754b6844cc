"""Partition bodies into subdomains, and assign the subdomains to ranks."""

import heapq
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix

from feti_homog.feti.thresholds import LENGTH_CLASSES, MAX_IMBALANCE, STRIP_SLACK, STRIP_WIDTHS
from feti_homog.mesh import CoarseMesh, Torus, periodic_topology
from feti_homog.system.parallel import distributed_arrays
from feti_homog.typing import Int


@dataclass(frozen=True)
class Partition:
    """The subdomain number (m,) of every coarse triangle, and the rank (s,) of every subdomain."""

    subdomain: Int
    rank: Int


def decompose(torus: Torus, parts: Int, pieces: Int, n_ranks: int, length_classes: int = LENGTH_CLASSES) -> Partition:
    """Cut the bodies of a whole cell into pieces, the subdomains, and assign them to `n_ranks` ranks.

    `parts`, `pieces` and `length_classes` are as in `cut_into_pieces`.
    """
    tail, head, edge = torus.sides
    subdomain = cut_into_pieces(torus, parts, pieces, torus.edge_lengths[edge].max(), length_classes)
    apart = subdomain[tail] != subdomain[head]
    neighbours = subdomain[tail[apart]], subdomain[head[apart]]
    return Partition(subdomain, assign_ranks(np.bincount(subdomain), *neighbours, n_ranks))


def halves(torus: Torus) -> Partition | None:
    """Cut a whole cell into two connected strips for two ranks; return None if a strip is not connected.

    The strips run along x or y, with about half the triangles each (within STRIP_SLACK), and with the fewest boundary
    edges among all candidates; METIS cuts are up to 50 % longer.  Islands of a strip first join the other strip.
    """
    tail, head, _ = torus.sides
    centres = torus.mesh.points[torus.mesh.triangles].mean(axis=1) / torus.mesh.period % 1.0
    strips, m = [], len(centres)
    for x in centres.T:
        place = np.empty(m, np.int64)
        place[np.argsort(x, kind="stable")] = np.arange(m)
        low, high = np.sort([place[tail], place[head]], axis=0)
        low, high = np.where(high - low > m / 2, (high, low + m), (low, high))
        # Number of sides that cross a position of the cyclic order; then its sum over both ends of a strip.
        crossed = np.bincount(low + 1, minlength=2 * m) - np.bincount(high + 1, minlength=2 * m)
        crossed = np.cumsum(crossed).reshape(2, m).sum(axis=0)
        ends = m // 2 + np.unique((STRIP_SLACK * m * np.linspace(-1.0, 1.0, STRIP_WIDTHS)).astype(np.int64))
        sums = np.stack([crossed + np.roll(crossed, -end) for end in ends])
        end, first = np.unravel_index(sums.argmin(), sums.shape)
        strips.append((place - first) % m < ends[end])
    piece = min(strips, key=lambda strip: int((strip[tail] != strip[head]).sum())).astype(np.int64)
    together = piece[tail] == piece[head]
    connected = periodic_topology.components(len(piece), tail[together], head[together])
    sizes = np.bincount(connected)
    main = [np.argmax(np.where(np.bincount(connected, piece) == sizes * k, sizes, 0)) for k in range(2)]
    piece ^= ~np.isin(connected, main)  # islands join the strip around them
    together = piece[tail] == piece[head]
    is_whole = periodic_topology.components(len(piece), tail[together], head[together]).max() == 1
    return Partition(piece, np.arange(2)) if is_whole else None


def blocks(mesh: CoarseMesh, count: int) -> tuple[Int, Int]:
    """Divide a mesh of square pixels into about `count` rectangles; return `parts` and `pieces` for `decompose`."""
    side = np.sqrt(mesh.width * mesh.height / count)
    grid = np.maximum(1, np.round(mesh.period / side)).astype(np.int64)
    column, row = (mesh.points[mesh.triangles[:, 0]] / mesh.period * grid).astype(np.int64).T
    return np.asarray(row * grid[0] + column), np.ones(grid.prod(), np.int64)


def cut_into_pieces(torus: Torus, parts: Int, pieces: Int, longest: float, length_classes: int = LENGTH_CLASSES) -> Int:
    """Compute the subdomain (m,) of every triangle by METIS.

    Subdomains are connected through edges: a METIS part that is not connected becomes several subdomains.  METIS makes
    short cuts, across narrow gaps and not along them, so that the iteration converges faster.

    Args:
        parts: (m,) body of every triangle: `torus.constituent`, or `torus.plane_parts()`.
        pieces: (b,) number of pieces of every body.
        longest: longest edge in the cell, a length.
        length_classes: number of edge lengths that METIS distinguishes; with 1 all edges have equal weight.
    """
    tail, head, edge = torus.sides
    inside = (parts[tail] == parts[head]) & (pieces[parts[tail]] > 1)
    left, right = tail[inside], head[inside]
    weight = np.ceil(length_classes * torus.edge_lengths[edge[inside]] / longest).astype(np.int64)
    members, sides = np.argsort(parts, kind="stable"), np.argsort(parts[left], kind="stable")
    load, edges = np.bincount(parts, minlength=len(pieces)), np.bincount(parts[left], minlength=len(pieces))
    first, first_edge = np.cumsum(load) - load, np.cumsum(edges) - edges
    number, piece = np.empty(len(parts), np.int64), np.zeros(len(parts), np.int64)
    number[members] = np.arange(len(parts)) - np.repeat(first, load)
    for body in np.flatnonzero(pieces > 1):
        inner = sides[first_edge[body] : first_edge[body] + edges[body]]
        graph = _graph(load[body], number[left[inner]], number[right[inner]], weight[inner])
        piece[members[first[body] : first[body] + load[body]]] = _metis(graph, int(pieces[body]))
    key = parts * (piece.max(initial=0) + 1) + piece
    together = key[tail] == key[head]
    connected = periodic_topology.components(len(parts), tail[together], head[together])
    # Numbers ascend body by body, so that consecutive subdomains are close to each other.
    return periodic_topology.renumber(connected, np.lexsort((connected, piece, parts)))


def pieces_for_count(load: Int, count: int) -> Int:
    """Choose piece counts (b,) of bodies with `load` (b,) triangles: cut the largest pieces, up to `count` in all."""
    pieces = np.ones(len(load), np.int64)
    heap = [(-float(size), body) for body, size in enumerate(load)]
    heapq.heapify(heap)
    for _ in range(count - len(load)):
        body = heap[0][1]
        if pieces[body] >= load[body]:
            break
        pieces[body] += 1
        heapq.heapreplace(heap, (-load[body] / pieces[body], body))
    return pieces


def pieces_for_size(load: Int, dofs_per_load: float, max_dofs: int) -> Int:
    """Choose piece counts (b,) of bodies with `load` (b,) triangles, for up to about `max_dofs` dofs in a piece."""
    return np.minimum(np.ceil(load * dofs_per_load / max_dofs).astype(np.int64), load)


def _graph(n: int, left: Int, right: Int, weight: Int) -> csr_matrix:
    """Build the adjacency matrix (n, n) from pairs (left, right); weights of repeated pairs add up."""
    both = (np.r_[left, right], np.r_[right, left])
    return coo_matrix((np.r_[weight, weight], both), shape=(n, n)).tocsr()


def _metis(graph: csr_matrix, count: int, load: Int | None = None) -> Int:
    """Return METIS parts (n,) of graph nodes: `count` parts of equal `load` (n,), or connected parts of equal size."""
    import pymetis  # slow to import, and small cells are not cut

    options = pymetis.Options(contig=int(load is None), seed=0)
    adjacency = pymetis.CSRAdjacency(graph.indptr, graph.indices)
    _, part = pymetis.part_graph(count, adjacency, eweights=graph.data, vweights=load, options=options)
    return np.asarray(part, np.int64)


def assign_ranks(load: Int, left: Int, right: Int, n_ranks: int) -> Int:
    """Assign subdomains with `load` (s,) triangles to ranks; return the rank (s,) of every subdomain.

    METIS keeps neighbours (left, right), one pair per shared edge, together.  If a rank would stay empty, or get more
    than MAX_IMBALANCE times the largest balanced load, only loads decide.  With too few subdomains, ranks stay empty.
    """
    by_load = distributed_arrays.balanced(load, n_ranks)
    if n_ranks == 1 or len(load) <= n_ranks:
        return by_load
    by_place = _metis(_graph(len(load), left, right, np.ones_like(left)), n_ranks, load)
    largest = [np.bincount(ranks, load, n_ranks).max() for ranks in (by_place, by_load)]
    return by_place if largest[0] <= MAX_IMBALANCE * largest[1] and len(np.unique(by_place)) == n_ranks else by_load
