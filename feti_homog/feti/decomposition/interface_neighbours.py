"""Interface nodes that lie beside each other, along which debonding spreads."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from mpi4py import MPI
from scipy.sparse import coo_matrix, csr_matrix, identity

from feti_homog.feti.decomposition.jump_operator import JumpOperator
from feti_homog.feti.decomposition.subdomain import Subdomain
from feti_homog.typing import Int

# Neighbours along the sides of a triangle: vertices 0, 1, 2, and the nodes 3, 4, 5 between them if there are any.
SIDES = {3: ((0, 1), (1, 2), (2, 0)), 6: ((0, 3), (3, 1), (1, 4), (4, 2), (2, 5), (5, 0))}


class InterfaceNeighbours:
    """The interface nodes of all ranks in the order of their rows, and their neighbours.

    Attributes:
        rows: (n,) global rows of their bonds, the first of each.
        first: number of this rank's first node.
        adjacency: (n, n) 1 between neighbours.
    """

    def __init__(self, comm: MPI.Intracomm, jump_operator: JumpOperator, subdomains: Sequence[Subdomain]) -> None:
        """Find the neighbours along interfaces.  Collective."""
        own = jump_operator.owned[0] + jump_operator.nodes.row
        if (np.diff(own) <= 0).any():
            raise ValueError("the interface nodes of a rank are not in the order of their rows")
        self.comm = comm
        self.rows: Int = np.concatenate(comm.allgather(own))
        self.first = int(np.searchsorted(self.rows, own[0])) if len(own) else 0
        bodies, n = np.concatenate(comm.allgather(jump_operator.nodes.bodies)), len(self.rows)
        number = self._node_numbers(jump_operator)
        # Both bodies have the side of an interface once: twice is within a body that is cut, and a void has none.
        outer, inner = (np.concatenate(comm.allgather(_sides(subdomains, number, body, n))) for body in bodies.T)
        a, b = np.divmod(np.intersect1d(_once(outer), _once(inner)), n)
        entries = np.ones(2 * len(a)), (np.concatenate([a, b]), np.concatenate([b, a]))
        self.adjacency: csr_matrix = coo_matrix(entries, shape=(n, n)).tocsr()
        self._components = jump_operator.components
        self._reached = self.adjacency + identity(n, format="csr")

    def rows_near(self, rows: Int, choose: Callable[[Int], Int], enough: int) -> Int:
        """Return global rows and those near them along the interfaces that `choose` returns, until they are enough."""
        bonds = np.unique(np.searchsorted(self.rows, rows, side="right") - 1)
        while True:
            near = (self.rows[bonds][:, None] + np.arange(self._components)).ravel()
            near = np.union1d(rows, choose(near))
            reached = np.unique(self._reached[bonds].indices)
            if len(near) >= enough or len(reached) == len(bonds):
                return near
            bonds = reached

    def _node_numbers(self, jump_operator: JumpOperator) -> Int:
        """(fine nodes of this rank,) number of the interface node that each is a copy of, or -1."""
        number = np.full(jump_operator.B.shape[1] // jump_operator.components, -1)
        normal = np.searchsorted(jump_operator.rows, self.rows)
        normal = np.minimum(normal, max(len(jump_operator.rows) - 1, 0))
        here = np.flatnonzero(jump_operator.rows[normal] == self.rows) if len(jump_operator.rows) else np.zeros(0, int)
        B = jump_operator.B[normal[here]].tocoo()
        number[B.col // jump_operator.components] = here[B.row]
        return number


def _sides(subdomains: Sequence[Subdomain], number: Int, body: Int, n: int) -> Int:
    """(e,) codes a n + b, a < b, of the outer sides of these subdomains between interface nodes a and b of n.

    `body` (n,) is the one of each node whose subdomains count, `number` as of `_node_numbers`.
    """
    found, first = [np.zeros(0, np.int64)], 0
    for s in subdomains:
        nodes = number[first + s.mesh.node_class[s.mesh.triangles]]
        first += s.mesh.n_classes
        ends = nodes[:, SIDES[nodes.shape[1]]].reshape(-1, 2)
        ends = ends[(ends >= 0).all(axis=1)]
        low, high = np.sort(ends[(body[ends] == s.submesh.body).all(axis=1)], axis=1).T
        found.append(_once(low * n + high))
    return np.concatenate(found)


def _once(values: Int) -> Int:
    """Return the values that are there once."""
    different, count = np.unique(values, return_counts=True)
    return np.asarray(different[count == 1])
