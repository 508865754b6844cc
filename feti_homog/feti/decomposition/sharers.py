"""Who shares which coarse vertices and edges, found by all ranks.

Each key has a home rank, key modulo ranks.  Every rank sends the homes which of its subdomains have a key that others
may have, too; the home puts the subdomains in order, and sends them to the ranks that have one.
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
    """n entities that several subdomains share, some of them this rank's: vertices, then edges, each by key.

    Attributes:
        key: (n,) class or torus edge.
        is_edge: (n,) bool.
        pointer, sharer: the subdomains that share entity i are sharer[pointer[i]:pointer[i + 1]], sorted by body, from
            the outermost to the innermost.
    """

    key: Int
    is_edge: Bool
    pointer: Int
    sharer: Int

    @property
    def copies(self) -> Int:
        """(n,) number of subdomains that share each."""
        return np.diff(self.pointer)

    @property
    def innermost(self) -> Int:
        """(n,) the last sharer of each."""
        return np.asarray(self.sharer[self.pointer[1:] - 1])

    @property
    def code(self) -> Int:
        """(n,) one number for each, in no order."""
        return entity_code(self.key, self.is_edge)

    def chosen(self, which: Int) -> Sharers:
        """Return the entities of these numbers (k,), in that order."""
        copies = self.copies[which]
        sharer = self.sharer[dividing.ranges(self.pointer[which], copies)]
        return Sharers(self.key[which], self.is_edge[which], np.r_[0, np.cumsum(copies)], sharer)


def entity_code(key: Int, is_edge: Bool | bool) -> Int:
    """(n,) one number for each class or torus edge of these keys (n,)."""
    return np.asarray(2 * key + is_edge)


def find_sharers(comm: MPI.Intracomm, meshes: SubmeshesOfRank, table: submeshes.SubdomainTable) -> Sharers:
    """Return the vertex classes, but for the pinned one, and the torus edges that subdomains share. Collective.

    Several subdomains share each, one on this rank at least.
    """
    mesh = meshes.whole
    corner, side = mesh.vertex_class[mesh.triangles], mesh.edge_class[mesh.triangle_edges]
    one_sided = np.bincount(side.ravel(), minlength=len(mesh.edge_keys)) == 1
    at_border = np.zeros(len(mesh.class_keys), bool)
    at_border[mesh.vertex_class[mesh.edges[one_sided[mesh.edge_class]]]] = True
    if mesh.pinned >= 0:
        corner = np.where(corner == mesh.pinned, -1, corner)
    # Codes of entities that other ranks may have, and local subdomains that have them; each pair once.
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
    # Each rank that has one of the sharers receives all.
    entity = np.repeat(np.arange(len(code)), copies)
    pairs = np.unique(entity * comm.size + table.rank[subdomain])
    entity, to = pairs // comm.size, pairs % comm.size
    code, count = distributed_arrays.exchange(comm, to, code[entity], copies[entity])
    whose = dividing.ranges(first[entity], copies[entity])
    (sharer,) = distributed_arrays.exchange(comm, np.repeat(to, copies[entity]), subdomain[whose])
    sharers = Sharers(code // 2, code % 2 == 1, np.r_[0, np.cumsum(count)], sharer)
    return sharers.chosen(np.lexsort((sharers.key, sharers.is_edge)))


def _several(keys: Int, member: Int, at_border: Bool) -> tuple[Int, Int]:
    """Return the keys of triangles (t, 3), negative ones left out.

    That several members (t,) have or that are at the border of all, and these members.
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
