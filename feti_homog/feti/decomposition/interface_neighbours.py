"""Neighbour subdomains, messages between them, and adjacent interface nodes."""

from collections.abc import Callable, Iterable, Sequence
from typing import TypeVar

import numpy as np
from mpi4py import MPI
from scipy.sparse import coo_matrix, csr_matrix

from feti_homog.feti.decomposition.jump_operator import JumpOperator
from feti_homog.feti.decomposition.subdomain import Subdomain
from feti_homog.typing import Int

Message = TypeVar("Message")
# Pairs of adjacent nodes along the sides of a triangle, by its number of nodes.
SIDES = {3: ((0, 1), (1, 2), (2, 0)), 6: ((0, 3), (3, 1), (1, 4), (4, 2), (2, 5), (5, 0))}


class Neighbours:
    """The neighbours of local subdomains: a subdomain itself, and all subdomains that share nodes with it.

    Attributes:
        index: global numbers of the local subdomains.
        local: position in `index` by global subdomain number.
        rank: rank of every subdomain in the cell, by global number.
        rows: rows[i] are the local rows at nodes of local subdomain i, ascending.
        common: common[i][s] are the rows at nodes that local subdomain i shares with subdomain s, as positions in
            rows[i], in the same order on both sides.
    """

    def __init__(self, comm: MPI.Intracomm, jump_operator: JumpOperator, subdomains: Sequence[Subdomain]) -> None:
        """Find the subdomains that share rows.  Collective."""
        self.comm = comm
        self.index = [s.submesh.index for s in subdomains]
        self.local = {s: i for i, s in enumerate(self.index)}
        self.rank = {s: r for r, indices in enumerate(comm.allgather(self.index)) for s in indices}
        shared, parts = jump_operator.shared, [np.zeros((3, 0), np.int64)]
        # Triples t, s, entity in ascending order, where local subdomain t and subdomain s share the entity.
        for k in np.unique(shared.copies):
            entity = np.flatnonzero(shared.copies == k)
            among, shape = shared.sharer[shared.pointer[entity][:, None] + np.arange(k)], (len(entity), k, k)
            columns = among[:, :, None], among[:, None, :], entity[:, None, None]
            parts.append(np.stack([np.broadcast_to(column, shape).ravel() for column in columns]))
        pairs = np.concatenate(parts, axis=1)
        pairs = pairs[:, np.isin(pairs[0], self.index)]
        first, second, entity = pairs[:, np.lexsort(pairs[::-1])]
        starts = np.flatnonzero((np.diff(first, prepend=-1) != 0) | (np.diff(second, prepend=-1) != 0))
        shared_rows: list[dict[int, Int]] = [{} for _ in self.index]
        for a, entities in zip(starts.tolist(), np.split(entity, starts)[1:], strict=True):
            shared_rows[self.local[int(first[a])]][int(second[a])] = jump_operator.rows_of(entities)
        none = np.zeros(0, np.int64)
        self.rows = [by_number.get(t, none) for t, by_number in zip(self.index, shared_rows, strict=True)]
        both = zip(self.rows, shared_rows, strict=True)
        self.common = [{s: np.searchsorted(at, rows) for s, rows in by_number.items()} for at, by_number in both]

    def exchange(
        self, messages: Iterable[tuple[int, int, Message]], deliver: Callable[[int, int, Message], None]
    ) -> None:
        """Deliver messages between subdomains.  Collective.

        Args:
            messages: (i, s, message) from local subdomain i to the subdomain with global number s.
            deliver: called on the rank of s with the local position of s, the global number of the sender, and the
                message; for messages within a rank, the call comes at once, while `messages` is read.
        """
        outgoing: list[list[tuple[int, int, Message]]] = [[] for _ in range(self.comm.size)]
        for i, s, message in messages:
            if s in self.local:
                deliver(self.local[s], self.index[i], message)
            else:
                outgoing[self.rank[s]].append((self.index[i], s, message))
        if self.comm.size > 1:
            for part in self.comm.alltoall(outgoing):
                for sender, to, message in part:
                    deliver(self.local[to], sender, message)


class InterfaceNeighbours:
    """The n interface nodes of the cell in row order, and adjacent nodes.

    Attributes:
        rows: (n,) first global row of the bond at every node.
        first: number of the first node on this rank; 0 on a rank without nodes.
        adjacency: (n, n) matrix with 1 between adjacent nodes.
        near: (n, most neighbours + 1) every node and its neighbours, padded with the node.
    """

    def __init__(self, comm: MPI.Intracomm, jump_operator: JumpOperator, subdomains: Sequence[Subdomain]) -> None:
        """Find adjacent nodes along interfaces; the rows of every rank must ascend.  Collective."""
        rows = jump_operator.owned[0] + jump_operator.nodes.row
        self.comm = comm
        self.rows: Int = np.concatenate(comm.allgather(rows))
        self.first = int(np.searchsorted(self.rows, rows[0])) if len(rows) else 0
        bodies, n = np.concatenate(comm.allgather(jump_operator.nodes.bodies)), len(self.rows)
        number = self.node_numbers(jump_operator)
        # Boundary sides of the subdomains in a body, between interface nodes a < b, as codes a n + b.
        none = np.zeros(0, np.int64)
        codes, first = ([none], [none]), 0
        for s in subdomains:
            nodes = number[first + s.mesh.node_class[s.mesh.triangles]]
            first += s.mesh.n_classes
            ends = nodes[:, SIDES[nodes.shape[1]]].reshape(-1, 2)
            ends = ends[(ends >= 0).all(axis=1)]
            for body, body_codes in zip(bodies.T, codes, strict=True):
                low, high = np.sort(ends[(body[ends] == s.submesh.body).all(axis=1)], axis=1).T
                body_codes.append(_once(low * n + high))
        # A side on an interface occurs once in each body, twice within a body that METIS cuts, never in a void.
        outer, inner = (_once(np.concatenate(comm.allgather(np.concatenate(body_codes)))) for body_codes in codes)
        a, b = np.divmod(np.intersect1d(outer, inner), n)
        entries = np.ones(2 * len(a)), (np.concatenate([a, b]), np.concatenate([b, a]))
        self.adjacency: csr_matrix = coo_matrix(entries, shape=(n, n)).tocsr()
        self._components = jump_operator.components
        count = np.diff(self.adjacency.indptr)
        self.near = np.repeat(np.arange(n)[:, None], count.max(initial=0) + 1, axis=1)
        within = np.arange(self.adjacency.nnz) - np.repeat(self.adjacency.indptr[:-1], count)
        self.near[np.repeat(np.arange(n), count), within] = self.adjacency.indices

    def rows_near(self, rows: Int, choose: Callable[[Int], Int], enough: int) -> Int:
        """Extend global `rows` by rows at adjacent nodes, ring by ring, to at least `enough` rows in ascending order.

        `choose` selects new rows from candidates.  The result has fewer rows if no further node is adjacent.
        """
        bonds = np.unique(np.searchsorted(self.rows, rows, side="right") - 1)
        while True:
            candidates = (self.rows[bonds][:, None] + np.arange(self._components)).ravel()
            result = np.union1d(rows, choose(candidates))
            extended = np.unique(self.near[bonds])
            if len(result) >= enough or len(extended) == len(bonds):
                return result
            bonds = extended

    def node_numbers(self, jump_operator: JumpOperator) -> Int:
        """Return the interface node number (local fine nodes,) of every local fine node; -1 off interfaces."""
        number = np.full(jump_operator.B.shape[1] // jump_operator.components, -1)
        _, node, normal = np.intersect1d(self.rows, jump_operator.rows, assume_unique=True, return_indices=True)
        B = jump_operator.B[normal].tocoo()
        number[B.col // jump_operator.components] = node[B.row]
        return number


def _once(values: Int) -> Int:
    """Return the values (k,) that occur exactly once in `values` (n,), in ascending order."""
    different, count = np.unique(values, return_counts=True)
    return np.asarray(different[count == 1])
