"""Subdomains that meet in constraints, and messages between them; interface nodes that lie beside each other."""

from collections.abc import Callable, Iterable, Sequence
from typing import TypeVar

import numpy as np
from mpi4py import MPI
from scipy.sparse import coo_matrix, csr_matrix

from feti_homog.feti.decomposition.jump_operator import JumpOperator
from feti_homog.feti.decomposition.subdomain import Subdomain
from feti_homog.typing import Int

Message = TypeVar("Message")
# Neighbours along the sides of a triangle: vertices 0, 1, 2, and the nodes 3, 4, 5 between them if there are any.
SIDES = {3: ((0, 1), (1, 2), (2, 0)), 6: ((0, 3), (3, 1), (1, 4), (4, 2), (2, 5), (5, 0))}


class Neighbours:
    """Pairs: a local subdomain t and any subdomain s that shares nodes with it, itself included.

    Attributes:
        index: global numbers of the local subdomains.
        local: their positions in `index`, by global number.
        rank: rank of every subdomain in the cell, by global number.
        rows: rows[i] local rows, ascending, of the nodes in local subdomain i.
        common: common[i][s] positions in rows[i] of the rows of the nodes that it shares with subdomain s, in the
            same order on both sides.
    """

    def __init__(self, comm: MPI.Intracomm, jump_operator: JumpOperator, subdomains: Sequence[Subdomain]) -> None:
        """Find the subdomains that share rows.  Collective."""
        self.comm = comm
        self.index = [s.submesh.index for s in subdomains]
        self.local = {s: i for i, s in enumerate(self.index)}
        self.rank = {s: r for r, indices in enumerate(comm.allgather(self.index)) for s in indices}
        shared, parts = jump_operator.shared, [np.zeros((3, 0), np.int64)]
        # Pairs (t, s) of subdomains that share an entity, t one of this rank's: t, s, entity in ascending order.
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
        self.rows = [of.get(t, none) for t, of in zip(self.index, shared_rows, strict=True)]
        self.common = [
            {s: np.searchsorted(indices, rows) for s, rows in of.items()}
            for indices, of in zip(self.rows, shared_rows, strict=True)
        ]

    def exchange(
        self, messages: Iterable[tuple[int, int, Message]], deliver: Callable[[int, int, Message], None]
    ) -> None:
        """Deliver messages between subdomains; within a rank as they come.  Collective.

        Args:
            messages: (i, s, message) from this rank's subdomain i to the subdomain of global number s.
            deliver: called on the rank of s with its position there, the global number of i, and the message.
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
    """All interface nodes in row order, and their neighbours.

    Attributes:
        rows: (n,) global rows of their bonds, the first of each.
        first: number of this rank's first node.
        adjacency: (n, n) 1 between neighbours.
    """

    def __init__(self, comm: MPI.Intracomm, jump_operator: JumpOperator, subdomains: Sequence[Subdomain]) -> None:
        """Find the neighbours along interfaces.  Collective."""
        rows = jump_operator.owned[0] + jump_operator.nodes.row
        if (np.diff(rows) <= 0).any():
            raise ValueError("the interface nodes of a rank are not in the order of their rows")
        self.comm = comm
        self.rows: Int = np.concatenate(comm.allgather(rows))
        self.first = int(np.searchsorted(self.rows, rows[0])) if len(rows) else 0
        bodies, n = np.concatenate(comm.allgather(jump_operator.nodes.bodies)), len(self.rows)
        number = self.node_numbers(jump_operator)
        # Outer sides of the subdomains of each body between interface nodes a < b, as codes a n + b.
        none = np.zeros(0, np.int64)
        codes, first = ([none], [none]), 0
        for s in subdomains:
            nodes = number[first + s.mesh.node_class[s.mesh.triangles]]
            first += s.mesh.n_classes
            ends = nodes[:, SIDES[nodes.shape[1]]].reshape(-1, 2)
            ends = ends[(ends >= 0).all(axis=1)]
            for body, of_body in zip(bodies.T, codes, strict=True):
                low, high = np.sort(ends[(body[ends] == s.submesh.body).all(axis=1)], axis=1).T
                of_body.append(_once(low * n + high))
        # Both bodies have the side of an interface once: twice is within a body that is cut, and a void has none.
        outer, inner = (_once(np.concatenate(comm.allgather(np.concatenate(of_body)))) for of_body in codes)
        a, b = np.divmod(np.intersect1d(outer, inner), n)
        entries = np.ones(2 * len(a)), (np.concatenate([a, b]), np.concatenate([b, a]))
        self.adjacency: csr_matrix = coo_matrix(entries, shape=(n, n)).tocsr()
        self._components = jump_operator.components
        # (n, most neighbours + 1) each node, its neighbours, and itself again where there are fewer.
        count = np.diff(self.adjacency.indptr)
        self._reached = np.repeat(np.arange(n)[:, None], count.max(initial=0) + 1, axis=1)
        within = np.arange(self.adjacency.nnz) - np.repeat(self.adjacency.indptr[:-1], count)
        self._reached[np.repeat(np.arange(n), count), within] = self.adjacency.indices

    def rows_near(self, rows: Int, choose: Callable[[Int], Int], enough: int) -> Int:
        """Return global rows and near ones along the interfaces that `choose` returns, until they are enough."""
        bonds = np.unique(np.searchsorted(self.rows, rows, side="right") - 1)
        while True:
            reached_rows = (self.rows[bonds][:, None] + np.arange(self._components)).ravel()
            reached_rows = np.union1d(rows, choose(reached_rows))
            reached = np.unique(self._reached[bonds])
            if len(reached_rows) >= enough or len(reached) == len(bonds):
                return reached_rows
            bonds = reached

    def node_numbers(self, jump_operator: JumpOperator) -> Int:
        """(local fine nodes,) number of the interface node that each copies, or -1."""
        number = np.full(jump_operator.B.shape[1] // jump_operator.components, -1)
        normal = np.searchsorted(jump_operator.rows, self.rows)
        normal = np.minimum(normal, max(len(jump_operator.rows) - 1, 0))
        local = np.flatnonzero(jump_operator.rows[normal] == self.rows) if len(jump_operator.rows) else np.zeros(0, int)
        B = jump_operator.B[normal[local]].tocoo()
        number[B.col // jump_operator.components] = local[B.row]
        return number


def _once(values: Int) -> Int:
    """Return the values that are there once."""
    different, count = np.unique(values, return_counts=True)
    return np.asarray(different[count == 1])
