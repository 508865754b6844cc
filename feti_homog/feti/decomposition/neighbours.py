"""Subdomains that meet in constraints, and messages between them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import TypeVar

import numpy as np
from mpi4py import MPI

from feti_homog.feti.decomposition.jump_operator import JumpOperator
from feti_homog.feti.decomposition.subdomain import Subdomain
from feti_homog.typing import Int

Message = TypeVar("Message")


class Neighbours:
    """The pairs of a subdomain t of this rank and any subdomain s that shares nodes with it, itself among them.

    Attributes:
        index: global number of each of this rank's subdomains.
        local: position in `index` of each of them, by its global number.
        rank: rank of every subdomain of the cell, by its global number.
        rows: rows[i] local rows, ascending, of the nodes of subdomain i of this rank.
        common: common[i][s] positions in rows[i] of the rows of the nodes that it shares with subdomain s, in the
            same order on both sides.
    """

    def __init__(self, comm: MPI.Intracomm, jump_operator: JumpOperator, subdomains: Sequence[Subdomain]) -> None:
        """Find the subdomains that share rows.  Collective."""
        self.comm = comm
        self.index = [s.submesh.index for s in subdomains]
        self.local = {s: i for i, s in enumerate(self.index)}
        self.rank = {s: r for r, own in enumerate(comm.allgather(self.index)) for s in own}
        shared_rows: list[dict[int, Int]] = [{} for _ in self.index]
        for t, s, entities in _pairs(jump_operator.shared.pointer, jump_operator.shared.sharer, self.index):
            shared_rows[self.local[t]][s] = jump_operator.rows_of(entities)
        none = np.zeros(0, np.int64)
        self.rows = [of.get(t, none) for t, of in zip(self.index, shared_rows, strict=True)]
        self.common = [
            {s: np.searchsorted(own, rows) for s, rows in of.items()}
            for own, of in zip(self.rows, shared_rows, strict=True)
        ]

    def exchange(
        self, messages: Iterable[tuple[int, int, Message]], deliver: Callable[[int, int, Message], None]
    ) -> None:
        """Deliver messages between subdomains; those within a rank are delivered as they come.  Collective.

        Args:
            messages: (i, s, message) from this rank's subdomain i to the subdomain of global number s.
            deliver: called on the rank of s with the position of s there, the global number of i, and the message.
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


def _pairs(pointer: Int, sharer: Int, own: Sequence[int]) -> Iterator[tuple[int, int, Int]]:
    """Pairs (t, s) of subdomains that share entities, t one of `own`: t, s and these; all in ascending order."""
    copies = np.diff(pointer)
    parts = []
    for k in np.unique(copies):
        entity = np.flatnonzero(copies == k)
        among = sharer[pointer[entity][:, None] + np.arange(k)]
        shape = (len(entity), k, k)
        parts.append(
            np.stack(
                [
                    np.broadcast_to(among[:, :, None], shape).ravel(),
                    np.broadcast_to(among[:, None, :], shape).ravel(),
                    np.broadcast_to(entity[:, None, None], shape).ravel(),
                ]
            )
        )
    pairs = np.concatenate(parts or [np.zeros((3, 0), np.int64)], axis=1)
    pairs = pairs[:, np.isin(pairs[0], own)]
    first, second, entity = pairs[:, np.lexsort(pairs[::-1])]
    new = np.ones(len(first), bool)
    new[1:] = (np.diff(first) != 0) | (np.diff(second) != 0)
    starts = np.flatnonzero(new)
    for a, entities in zip(starts.tolist(), np.split(entity, starts)[1:], strict=True):
        yield int(first[a]), int(second[a]), entities
