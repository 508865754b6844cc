"""Which subdomains share which coarse vertices and edges, with the numbers of their constraints.

An entity is a vertex class or a torus edge that belongs to several subdomains.  Each fine node on an entity of k
subdomains needs k - 1 vector constraints.  It belongs to the rank of its last sharer, which numbers these and tells the
others.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from feti_homog.feti.decomposition.interface_geometry import breakable_pairs, interface_geometry
from feti_homog.feti.decomposition.sharers import Sharers, find_sharers
from feti_homog.mesh.refinement import ReferenceLattice
from feti_homog.mesh.submesh import SubdomainTable, SubmeshesOfRank
from feti_homog.parallel.distributed_arrays import exchange
from feti_homog.typing import Array, Bool, Float, Int


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
        fibre: (n,) the body that may debond here from the one around it, the inner one; or -1 where nothing can break.
        pair: (n,) the interface of the case that these two bodies have, -1 where nothing can break.
        normal: (n, 2, 2) normals from the inner to the outer body at the start and the end of the edge, as long as dx /
            ds, s in [0, 1] the place along it; at a vertex, where sides of elements meet, as long as dx / ds on these
            together.
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


def share_entities(
    comm: MPI.Intracomm, own: SubmeshesOfRank, table: SubdomainTable, pairs: Int, lattice: ReferenceLattice
) -> SharedEntities:
    """Return the shared entities of this rank; constraints are numbered rank by rank. Collective.

    Args:
        pairs: (phases, phases) the interface of the case between two phases, -1 where they never part.
        lattice: of the coarse triangles.
    """
    found = find_sharers(comm, own, table)
    geometry = interface_geometry(comm, own, table, pairs, found, lattice.order / lattice.intervals)
    if lattice.intervals == 1:
        vertices = np.flatnonzero(~found.is_edge)
        found, geometry = found.chosen(vertices), geometry.chosen(vertices)
    nodes = np.where(found.is_edge, lattice.intervals - 1, 1)
    owner = table.rank[found.innermost]
    constraints = np.where(owner == comm.rank, nodes * (found.copies - 1), 0)
    begin, own_constraints = comm.exscan(int(constraints.sum())) or 0, int(constraints.sum())
    numbers = begin + np.cumsum(constraints) - constraints
    first, normal, turn, precracked = _told_by_owners(
        comm, found, table, numbers, geometry.normal, geometry.turn, geometry.precracked
    )
    order = np.argsort(first)
    found = found.chosen(order)
    pair = breakable_pairs(own, table, pairs, found)
    return SharedEntities(
        key=found.key,
        is_edge=found.is_edge,
        nodes=nodes[order],
        first=first[order],
        pointer=found.pointer,
        sharer=found.sharer,
        body=table.body[found.sharer],
        fibre=np.where(pair >= 0, table.body[found.innermost], -1),
        pair=pair,
        normal=normal[order],
        turn=turn[order],
        precracked=precracked[order] & (pair >= 0),
        owned=(begin, begin + own_constraints),
        constraints=comm.allreduce(own_constraints),
    )


def _told_by_owners(comm: MPI.Intracomm, found: Sharers, table: SubdomainTable, *columns: Array) -> list[Array]:
    """Return the columns (n,) or (n, ...) of the entities, each row as the owner of the entity has it. Collective."""
    rank = table.rank[found.sharer]
    mine = np.repeat(table.rank[found.innermost] == comm.rank, found.copies)
    entity = np.repeat(np.arange(len(found.key)), found.copies)
    pairs = np.unique(entity[mine] * comm.size + rank[mine])
    entity, to = pairs // comm.size, pairs % comm.size
    code, *received = exchange(comm, to, found.code[entity], *(column[entity] for column in columns))
    order = np.argsort(code)
    place = order[np.searchsorted(code[order], found.code)]
    return [column[place] for column in received]
