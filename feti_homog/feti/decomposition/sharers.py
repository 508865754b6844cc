"""Search for the subdomains that share coarse vertices and edges, by all ranks together.

Each key has a home rank, key modulo ranks.  Every rank tells the homes which of its subdomains have a key that other
subdomains may have, too.  The home sorts the subdomains of a key, and sends them to all ranks that have one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from feti_homog.mesh import SubmeshesOfRank, submeshes
from feti_homog.system.parallel import distributed_arrays, dividing
from feti_homog.typing import Bool, Int


@dataclass(frozen=True)
class Sharers:
    """The n entities that local subdomains share with other subdomains: vertices, then edges, sorted by key.

    Attributes:
        key: (n,) vertex class or torus edge.
        is_edge: (n,) whether the entity is an edge.
        pointer, sharer: the subdomains that share entity i are sharer[pointer[i]:pointer[i + 1]], sorted by body, from
            the outermost to the innermost.
    """

    key: Int
    is_edge: Bool
    pointer: Int
    sharer: Int

    @property
    def copies(self) -> Int:
        """(n,) number of subdomains that share each entity."""
        return np.diff(self.pointer)

    @property
    def innermost(self) -> Int:
        """(n,) the last sharer of each entity."""
        return np.asarray(self.sharer[self.pointer[1:] - 1])

    @property
    def code(self) -> Int:
        """(n,) one unique number for each entity, not sorted."""
        return entity_code(self.key, self.is_edge)

    def chosen(self, which: Int) -> Sharers:
        """Return the entities with the numbers `which` (k,), in that order."""
        copies = self.copies[which]
        sharer = self.sharer[dividing.ranges(self.pointer[which], copies)]
        return Sharers(self.key[which], self.is_edge[which], np.r_[0, np.cumsum(copies)], sharer)


def entity_code(key: Int, is_edge: Bool | bool) -> Int:
    """Encode vertex classes or torus edges with the keys (n,) as unique numbers (n,)."""
    return np.asarray(2 * key + is_edge)


def find_sharers(comm: MPI.Intracomm, meshes: SubmeshesOfRank, table: submeshes.SubdomainTable) -> Sharers:
    """Find the vertex classes and torus edges that local subdomains share.  Collective.

    The pinned class is left out.
    """
    mesh = meshes.whole
    corner, side = mesh.vertex_class[mesh.triangles], mesh.edge_class[mesh.triangle_edges]
    one_sided = np.bincount(side.ravel(), minlength=len(mesh.edge_keys)) == 1
    at_border = np.zeros(len(mesh.class_keys), bool)
    at_border[mesh.vertex_class[mesh.edges[one_sided[mesh.edge_class]]]] = True
    if mesh.pinned >= 0:
        corner = np.where(corner == mesh.pinned, -1, corner)
    # Unique pairs of an entity that other ranks may have, as a code, and a local subdomain.
    kinds = [
        (entity_code(keys[local], is_edge), meshes.index[member])
        for is_edge, keys, (local, member) in (
            (False, mesh.class_keys, _several(corner, meshes.member, at_border)),
            (True, mesh.edge_keys, _several(side, meshes.member, one_sided)),
        )
    ]
    code, subdomain = (np.concatenate(some) for some in zip(*kinds, strict=True))
    code, subdomain = distributed_arrays.exchange(comm, code // 2 % comm.size, code, subdomain)
    order = np.lexsort((subdomain, table.nesting[table.body[subdomain]], code))
    code, subdomain = code[order], subdomain[order]
    _, entity, copies = np.unique(code, return_inverse=True, return_counts=True)
    shared = copies[entity] > 1
    code, subdomain = code[shared], subdomain[shared]
    code, first, copies = np.unique(code, return_index=True, return_counts=True)
    # Each rank with a sharer of an entity receives all sharers of this entity.
    entity = np.repeat(np.arange(len(code)), copies)
    pairs = np.unique(entity * comm.size + table.rank[subdomain])
    entity, to = pairs // comm.size, pairs % comm.size
    code, count = distributed_arrays.exchange(comm, to, code[entity], copies[entity])
    whose = dividing.ranges(first[entity], copies[entity])
    (sharer,) = distributed_arrays.exchange(comm, np.repeat(to, copies[entity]), subdomain[whose])
    sharers = Sharers(code // 2, code % 2 == 1, np.r_[0, np.cumsum(count)], sharer)
    return sharers.chosen(np.lexsort((sharers.key, sharers.is_edge)))


def _several(keys: Int, member: Int, at_border: Bool) -> tuple[Int, Int]:
    """Return pairs of key and member for keys (t, 3) that several members have or that lie at the border.

    `member` (t,) is the member of each triangle.  Negative keys are left out.
    """
    n = int(member.max(initial=0)) + 1
    low, high = np.full(len(at_border) + 1, n), np.full(len(at_border) + 1, -1)
    for corner in keys.T:
        np.minimum.at(low, corner, member)
        np.maximum.at(high, corner, member)
    sent = (low[:-1] < high[:-1]) | at_border
    chosen = (keys >= 0) & sent[keys]
    pairs = np.unique(keys[chosen] * n + np.broadcast_to(member[:, None], keys.shape)[chosen])
    return pairs // n, pairs % n
