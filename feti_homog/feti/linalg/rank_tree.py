"""The tree on which ranks meet to eliminate shared unknowns: neighbours first, by nested bisection of the ranks."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pymetis
from mpi4py import MPI
from scipy.sparse import csr_matrix

from feti_homog.parallel.mpi_errors import on_root
from feti_homog.typing import Bool, Int


class Meeting(NamedTuple):
    """The ranks of a group, the first half before the second, which begins at `second`; each half has met before, and
    what it has left is known to its first rank."""

    comm: MPI.Intracomm
    second: int


class RankTree:
    """The meetings of this rank, of ever larger groups, the last of all ranks.

    Groups of ranks are halved such that few unknowns are in both halves, until each is one rank.
    """

    def __init__(self, comm: MPI.Intracomm, total: int, unknowns: Int) -> None:
        """`unknowns` (u,) are numbers below `total` of those that this rank has; several ranks may have one.
        Collective."""
        self.comm = comm
        every = comm.gather(unknowns[copies(comm, total, unknowns) > 1])
        groups = on_root(comm, nested_groups, every)
        self.meetings = [Meeting(subgroup(comm, ranks), second) for ranks, second in groups if comm.rank in ranks]

    def destroy(self) -> None:
        """Free the communicators.  Collective."""
        for meeting in self.meetings:
            meeting.comm.Free()
        self.meetings.clear()


def subgroup(comm: MPI.Intracomm, ranks: Sequence[int]) -> MPI.Intracomm:
    """Some of the ranks, in that order.  Collective among these."""
    whole = comm.Get_group()
    some = whole.Incl(ranks)
    of_some = MPI.Intracomm(comm.Create_group(some))
    for group in (whole, some):
        group.Free()
    return of_some


def copies(comm: MPI.Intracomm, total: int, unknowns: Int) -> Int:
    """(u,) how many ranks have each of these unknowns.  Collective."""
    count = np.zeros(total, np.int64)
    count[unknowns] = 1
    comm.Allreduce(MPI.IN_PLACE, count)
    return np.asarray(count[unknowns])


def nested_groups(every: Sequence[Int]) -> list[tuple[list[int], int]]:
    """The ranks of each group of two or more, and where the second half begins, parts before the whole; for the numbers
    of unknowns that each rank shares with others."""
    numbers = np.unique(np.concatenate(every), return_inverse=True)[1]
    pointer = np.concatenate([[0], np.cumsum([len(some) for some in every])])
    holders = csr_matrix((np.ones(len(numbers), np.int64), numbers, pointer), (len(every), len(numbers)))
    common = (holders @ holders.T).tocsr()
    groups: list[tuple[list[int], int]] = []

    def halved(ranks: Int) -> list[int]:
        """These ranks in the order of the group."""
        if len(ranks) == 1:
            return [int(ranks[0])]
        is_first = _half(common[ranks][:, ranks])
        first, second = halved(ranks[is_first]), halved(ranks[~is_first])
        groups.append((first + second, len(first)))
        return first + second

    halved(np.arange(len(every)))
    return groups


def _half(common: csr_matrix) -> Bool:
    """(r,) which of the ranks are in the first of two halves that have little in common; the first rank is."""
    size = common.shape[0]
    graph = common.tocoo()
    apart = graph.row != graph.col
    graph = csr_matrix((graph.data[apart], (graph.row[apart], graph.col[apart])), common.shape)
    adjacency = pymetis.CSRAdjacency(graph.indptr, graph.indices)
    options = pymetis.Options(seed=0)
    part = np.asarray(pymetis.part_graph(2, adjacency, eweights=graph.data, options=options, recursive=True)[1])
    first = part == part[0]
    # METIS may leave a half empty where ranks have nothing in common.
    return np.asarray(first) if not first.all() else np.arange(size) < (size + 1) // 2
