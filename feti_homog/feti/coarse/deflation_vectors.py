"""The coarse vectors U = M^-1 B V of the kernels and soft modes V of all subdomains."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from mpi4py import MPI
from scipy.sparse import csr_matrix

from feti_homog.feti.coarse.local_eigenproblems import SubdomainBlocks
from feti_homog.feti.decomposition.jump_operator import JumpOperator
from feti_homog.feti.decomposition.neighbours import Neighbours
from feti_homog.feti.linalg.dense_block_sum import DenseBlockSum
from feti_homog.feti.linalg.distributed_matrix import add_shared_rows
from feti_homog.typing import Float, Int

# Rows of the receiver, numbers of coarse vectors, and their jumps there (rows, vectors).
Jumps = tuple[Int, Int, Float]

# Vectors that are found at once; and entries, relative to the largest, that those of a large body do without: they
# decay within few fibres.
CHUNK, FAINT = 128, 1e-5


def preconditioned(
    comm: MPI.Intracomm,
    jump_operator: JumpOperator,
    blocks: Sequence[SubdomainBlocks],
    neighbours: Neighbours,
    V: Sequence[Float],
) -> csr_matrix:
    """(local rows, vectors) U = M^-1 B V.  Collective."""
    counts = np.array([v.shape[1] for v in V], dtype=np.int64)
    every = np.zeros(len(neighbours.rank), np.int64)
    every[neighbours.index] = counts
    comm.Allreduce(MPI.IN_PLACE, every)
    ends = np.cumsum(every)

    def jumps() -> Iterator[tuple[int, int, tuple[Int, Float]]]:
        for i, (block, v) in enumerate(zip(blocks, V, strict=True)):
            Z, last = block.B @ v, ends[neighbours.index[i]]
            for s, common in neighbours.common[i].items():
                seen = np.flatnonzero(Z[common].any(axis=0))
                yield i, s, (last - v.shape[1] + seen, Z[np.ix_(common, seen)])

    received: list[list[Jumps]] = [[] for _ in blocks]
    neighbours.exchange(jumps(), lambda i, sender, of: received[i].append((neighbours.common[i][sender], *of)))
    U = DenseBlockSum((len(jump_operator.rows), int(every.sum())))
    for i, (block, rows) in enumerate(zip(blocks, neighbours.rows, strict=True)):
        for some in _groups(received[i]):
            columns = np.concatenate([c for _, c, _ in some])
            jump, at = np.zeros((len(rows), len(columns))), 0
            for where, _, Z in some:
                jump[where, at : at + Z.shape[1]] = Z
                at += Z.shape[1]
            vectors = block.BW @ block.operator.apply_schur(block.BW.T @ jump)
            if block.facewise:
                U.add_entries_above(rows, columns, vectors, FAINT * np.abs(vectors).max(axis=0))
            else:
                U.add(rows, columns, vectors)
    owned = jump_operator.owned[1] - jump_operator.owned[0]
    return add_shared_rows(comm, U.matrix(), jump_operator.rows, jump_operator.is_shared_row, owned)


def _groups(messages: Sequence[Jumps]) -> Iterator[list[Jumps]]:
    """The same jumps, at most CHUNK columns at a time."""
    group: list[Jumps] = []
    width = 0
    for where, columns, Z in messages:
        for first in range(0, len(columns), CHUNK):
            some = slice(first, first + CHUNK)
            if width + len(columns[some]) > CHUNK:
                yield group
                group, width = [], 0
            group.append((where, columns[some], Z[:, some]))
            width += len(columns[some])
    if group:
        yield group
