"""Which subdomains meet in which constraints, and what they tell each other."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
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
        rows: rows[i] local rows, ascending, of the nodes of subdomain i of this rank.
        common: common[i][s] positions in rows[i] of the rows of the nodes that it shares with subdomain s, in the
            same order on both sides.
    """

    def __init__(self, comm: MPI.Intracomm, jump_operator: JumpOperator, subdomains: Sequence[Subdomain]) -> None:
        self.comm = comm
        self.index = [s.submesh.index for s in subdomains]
        self.local = {s: i for i, s in enumerate(self.index)}
        self.rank = {s: r for r, own in enumerate(comm.allgather(self.index)) for s in own}
        first, second, entity = _pairs(jump_operator.shared.pointer, jump_operator.shared.sharer, self.index)
        order = np.lexsort((entity, second, first))
        first, second, entity = first[order], second[order], entity[order]
        new = np.ones(len(first), bool)
        new[1:] = (np.diff(first) != 0) | (np.diff(second) != 0)
        starts = np.flatnonzero(new)
        self.rows: list[Int] = [np.zeros(0, np.int64) for _ in self.index]
        groups = [
            (self.local[int(first[a])], int(second[a]), jump_operator.rows_of(some))
            for a, some in zip(starts, np.split(entity, starts)[1:], strict=True)
        ]
        for i, s, rows in groups:
            if s == self.index[i]:
                self.rows[i] = rows
        self.common: list[dict[int, Int]] = [{} for _ in self.index]
        for i, s, rows in groups:
            self.common[i][s] = np.searchsorted(self.rows[i], rows)

    def exchange(
        self, messages: Iterable[tuple[int, int, Message]], deliver: Callable[[int, int, Message], None]
    ) -> None:
        """For each (from local subdomain i, to subdomain s, message) call deliver(local s, i's number, message) on the
        rank of s; messages within a rank are delivered as they come.  Collective."""
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


def _pairs(pointer: Int, sharer: Int, own: Sequence[int]) -> tuple[Int, Int, Int]:
    """Pairs (t, s) of sharers of the same entity, t one of `own`, and the entity."""
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
    first, second, entity = np.concatenate(parts or [np.zeros((3, 0), np.int64)], axis=1)
    mine = np.isin(first, own)
    return first[mine], second[mine], entity[mine]
