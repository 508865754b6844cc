"""Which subdomains share which coarse vertices and edges: found on rank 0, and sent to the ranks concerned.

An entity is a vertex class or a torus edge that belongs to several subdomains.  Each fine node on an entity of k
subdomains needs k - 1 vector constraints, so these are numbered by arithmetic and no rank asks another.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from feti_homog.cell.periodic_topology import Torus
from feti_homog.cell.refinement import ReferenceLattice
from feti_homog.cell.submesh import pinned_class
from feti_homog.feti.decomposition.interface_geometry import interface_geometry
from feti_homog.typing import Bool, Float, Int


@dataclass(frozen=True)
class SharedEntities:
    """The n entities that one rank's subdomains take part in, in the order of their constraints.

    Attributes:
        key: (n,) class or torus edge.
        is_edge: (n,) bool.
        nodes: (n,) fine nodes on the entity: 1, or the inner lattice nodes of an edge.
        first: (n,) number of its first vector constraint.
        pointer, sharer: the subdomains that share entity i are sharer[pointer[i]:pointer[i + 1]], sorted by body, from
            the outermost to the innermost.
        body: constituent of each sharer.
        fibre: (n,) the body that may debond here from the one around it, a fibre or a coating in general; or -1 where
            nothing can break.
        pair: (n,) the interface of the case that these two bodies have, -1 where nothing can break.
        normal: (n, 2, 2) normals from fibre to matrix at the start and the end of the edge, as long as dx / ds, s in
            [0, 1] the place along it; at a vertex, where sides of elements meet, as long as dx / ds on these together.
        turn: (n,) of the edge, as in `Submesh`; 0 at vertices.
        precracked: (n,) whether the mesh has the edge, or all edges that meet in the vertex, debonded.
        owned: (2,) first vector constraint of this rank and the one after its last.
        constraints: number of vector constraints on all ranks.
    """

    key: Int
    is_edge: Bool
    nodes: Int
    first: Int
    pointer: Int
    sharer: Int
    body: Int
    fibre: Int
    pair: Int
    normal: Float
    turn: Float
    precracked: Bool
    owned: tuple[int, int]
    constraints: int

    @property
    def copies(self) -> Int:
        """(n,) number of subdomains k that share each entity."""
        return np.diff(self.pointer)

    def restricted(self, mask: Bool, owned: tuple[int, int]) -> SharedEntities:
        """The entities where `mask` (n,) is true, for a rank that owns the constraints from owned[0] up to owned[1]."""
        sharers = _ranges(self.pointer[:-1][mask], self.copies[mask])
        return replace(
            self,
            key=self.key[mask],
            is_edge=self.is_edge[mask],
            nodes=self.nodes[mask],
            first=self.first[mask],
            pointer=np.r_[0, np.cumsum(self.copies[mask])],
            sharer=self.sharer[sharers],
            body=self.body[sharers],
            fibre=self.fibre[mask],
            pair=self.pair[mask],
            normal=self.normal[mask],
            turn=self.turn[mask],
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


def share_entities(
    torus: Torus, pairs: Int, subdomain: Int, rank: Int, lattice: ReferenceLattice, n_ranks: int
) -> Iterator[SharedEntities]:
    """The shared entities of each rank, in the order of ranks.

    An entity belongs to the rank of its last sharer; constraints are numbered rank by rank.

    Args:
        pairs: (phases, phases) the interface of the case between two phases, -1 where they never part.
        subdomain: (m,) of each triangle.
        rank: (s,) rank of each subdomain.
        lattice: of the coarse triangles.
    """
    body = torus.constituent[np.unique(subdomain, return_index=True)[1]]
    found = _find_sharers(torus, subdomain, torus.nesting[body], edges_have_nodes=lattice.intervals > 1)
    owner = rank[found.sharer[found.pointer[1:] - 1]] if len(found.key) else np.zeros(0, np.int64)
    order = np.argsort(owner, kind="stable")
    found, owner = found.reordered(order), owner[order]
    copies = np.diff(found.pointer)
    nodes = np.where(found.is_edge, lattice.intervals - 1, 1)
    ends = np.r_[0, np.cumsum(nodes * (copies - 1))]
    body = body[found.sharer]
    side = lattice.order / lattice.intervals
    interface = interface_geometry(torus, pairs, found.key, found.is_edge, found.pointer, body, side)
    whole = SharedEntities(
        key=found.key,
        is_edge=found.is_edge,
        nodes=nodes,
        first=ends[:-1],
        pointer=found.pointer,
        sharer=found.sharer,
        body=body,
        fibre=interface.fibre,
        pair=interface.pair,
        normal=interface.normal,
        turn=interface.turn,
        precracked=interface.precracked,
        owned=(0, int(ends[-1])),
        constraints=int(ends[-1]),
    )
    limits = ends[np.searchsorted(owner, np.arange(n_ranks + 1))].tolist()
    entity = np.repeat(np.arange(len(found.key)), copies)
    for r in range(n_ranks):
        takes_part = np.zeros(len(found.key), bool)
        takes_part[entity[rank[found.sharer] == r]] = True
        yield whole.restricted(takes_part, (limits[r], limits[r + 1]))


def _find_sharers(torus: Torus, subdomain: Int, nesting: Int, edges_have_nodes: bool) -> _Sharers:
    """The vertex classes, but for the pinned one, and the torus edges that several subdomains share; `subdomain` (m,)
    is that of each triangle, `nesting` (s,) the place of the body of each."""
    key, copies, sharer = _several(torus.node_class[torus.mesh.triangles], subdomain, nesting)
    kept = key != pinned_class(torus)
    kinds = [(key[kept], copies[kept], sharer[np.repeat(kept, copies)])]
    if edges_have_nodes:
        kinds.append(_several(torus.triangle_torus_edges, subdomain, nesting))
    key, copies, sharer = (np.concatenate(a) for a in zip(*kinds, strict=True))
    is_edge = np.repeat([False, True][: len(kinds)], [len(k[0]) for k in kinds])
    return _Sharers(key, is_edge, np.r_[0, np.cumsum(copies)], sharer)


def _several(keys: Int, subdomain: Int, nesting: Int) -> tuple[Int, Int, Int]:
    """Which of the keys (m, 3) of triangles several subdomains have, how many, and which: sorted by key, then place
    (s,) of the body, then subdomain."""
    n = len(nesting)
    low, high = np.full(keys.max() + 1, n), np.full(keys.max() + 1, -1)
    for corner in keys.T:
        np.minimum.at(low, corner, subdomain)
        np.maximum.at(high, corner, subdomain)
    shared = low[keys] != high[keys]
    both = np.unique(keys[shared] * n + np.broadcast_to(subdomain[:, None], keys.shape)[shared])
    key, whose = both // n, both % n
    order = np.lexsort((whose, nesting[whose], key))
    unique, count = np.unique(key, return_counts=True)
    return unique, count, whose[order]


def _ranges(start: Int, count: Int) -> Int:
    """start[0] .. start[0] + count[0] - 1, start[1] .. and so on."""
    ends = np.cumsum(count)
    shift: Int = np.repeat(start - ends + count, count)
    return shift + np.arange(count.sum(), dtype=np.int64)
