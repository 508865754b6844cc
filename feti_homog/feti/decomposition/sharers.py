"""Find the subdomains that share coarse vertices and edges, by messages between all ranks.

A vertex or edge has a key, and a home rank: the key modulo the number of ranks.  Every rank sends the keys that several
subdomains may share to the home ranks, with the rank's own subdomains at each key.  A home rank sorts all subdomains of
a key, and sends the list to every rank with one of these subdomains.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from feti_homog.mesh import SubmeshesOfRank, submeshes
from feti_homog.system.parallel import distributed_arrays
from feti_homog.typing import Bool, Int


@dataclass(frozen=True)
class Sharers:
    """The n entities that local subdomains share with other subdomains.

    Attributes:
        key: (n,) vertex class or torus edge.
        is_edge: (n,) whether the entity is an edge.
        pointer, sharer: sharer[pointer[i]:pointer[i + 1]] are the subdomains at entity i, from the outermost body to
            the innermost.
    """

    key: Int
    is_edge: Bool
    pointer: Int
    sharer: Int

    @property
    def copies(self) -> Int:
        """Return the number (n,) of sharers of every entity."""
        return np.diff(self.pointer)

    @property
    def innermost(self) -> Int:
        """Return the last sharer (n,) of every entity, in the innermost body."""
        return np.asarray(self.sharer[self.pointer[1:] - 1])

    @property
    def code(self) -> Int:
        """Return the codes (n,) of the entities, not sorted; see `entity_code`."""
        return entity_code(self.key, self.is_edge)

    def chosen(self, which: Int) -> Sharers:
        """Return the entities with the numbers `which` (k,), in this order."""
        copies = self.copies[which]
        sharer = self.sharer[distributed_arrays.ranges(self.pointer[which], copies)]
        return Sharers(self.key[which], self.is_edge[which], np.r_[0, np.cumsum(copies)], sharer)


def entity_code(key: Int, is_edge: Bool | bool) -> Int:
    """Encode keys of vertex classes or torus edges as unique codes in an array of equal shape, odd for edges."""
    return np.asarray(2 * key + is_edge)


def find_sharers(comm: MPI.Intracomm, meshes: SubmeshesOfRank, table: submeshes.SubdomainTable) -> Sharers:
    """Find the shared vertices, except pinned classes, and then the shared edges, both sorted by key.  Collective."""
    mesh = meshes.whole
    corner, side = mesh.vertex_class[mesh.triangles], mesh.edge_class[mesh.triangle_edges]
    one_sided = np.bincount(side.ravel(), minlength=len(mesh.edge_keys)) == 1
    at_border = np.zeros(len(mesh.class_keys), bool)
    at_border[mesh.vertex_class[mesh.edges[one_sided[mesh.edge_class]]]] = True
    corner = np.where(np.isin(corner, mesh.pinned), -1, corner)
    # Unique pairs: the code of an entity that subdomains may share, and a local subdomain at the entity.
    vertex, at_vertex = _several(corner, meshes.member, at_border)
    edge, at_edge = _several(side, meshes.member, one_sided)
    code = np.concatenate([entity_code(mesh.class_keys[vertex], False), entity_code(mesh.edge_keys[edge], True)])
    subdomain = meshes.index[np.concatenate([at_vertex, at_edge])]
    code, subdomain = distributed_arrays.exchange(comm, code // 2 % comm.size, code, subdomain)
    order = np.lexsort((subdomain, table.nesting[table.body[subdomain]], code))
    code, subdomain = code[order], subdomain[order]
    _, entity, copies = np.unique(code, return_inverse=True, return_counts=True)
    shared = copies[entity] > 1
    code, subdomain = code[shared], subdomain[shared]
    code, first, copies = np.unique(code, return_index=True, return_counts=True)
    entity = np.repeat(np.arange(len(code)), copies)
    entity, to = np.divmod(np.unique(entity * comm.size + table.rank[subdomain]), comm.size)
    code, count = distributed_arrays.exchange(comm, to, code[entity], copies[entity])
    whose = distributed_arrays.ranges(first[entity], copies[entity])
    (sharer,) = distributed_arrays.exchange(comm, np.repeat(to, copies[entity]), subdomain[whose])
    sharers = Sharers(code // 2, code % 2 == 1, np.r_[0, np.cumsum(count)], sharer)
    return sharers.chosen(np.lexsort((sharers.key, sharers.is_edge)))


def _several(keys: Int, member: Int, at_border: Bool) -> tuple[Int, Int]:
    """Return unique pairs (key, member), two arrays (k,), of `keys` (t, corners) and local subdomains `member` (t,).

    Only keys with several members, or `at_border` (number of keys,), count; negative keys are skipped.
    """
    n = int(member.max(initial=0)) + 1
    # One member of each key; the key is shared if another member differs.  The last entry is for negative keys.
    one, may_be_shared = np.empty(len(at_border) + 1, np.int64), np.append(at_border, False)
    one[keys] = member[:, None]
    may_be_shared[keys[one[keys] != member[:, None]]] = True
    chosen = (keys >= 0) & may_be_shared[keys]
    pairs = np.unique(keys[chosen] * n + np.broadcast_to(member[:, None], keys.shape)[chosen])
    return pairs // n, pairs % n
