"""The coarse vectors U = M^-1 B V of the kernels and soft modes V of all subdomains."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from mpi4py import MPI
from scipy.sparse import csr_matrix

from feti_homog.feti.coarse.local_eigenproblems import SubdomainBlocks
from feti_homog.feti.decomposition.jump_operator import JumpOperator
from feti_homog.feti.decomposition.neighbours import Neighbours
from feti_homog.feti.linalg.dense_block_sum import DenseBlockSum
from feti_homog.feti.linalg.distributed_matrix import add_shared_rows
from feti_homog.feti.thresholds import DEFAULTS, VECTOR_CHUNK
from feti_homog.typing import Float, Int


class _Jumps(NamedTuple):
    """What a neighbour's modes open on the rows of a subdomain: B V there.

    `rows` (r,) are positions among the subdomain's rows, `columns` (c,) numbers of coarse vectors, `values` (r, c).
    """

    rows: Int
    columns: Int
    values: Float


def deflation_vectors(
    comm: MPI.Intracomm,
    jump_operator: JumpOperator,
    blocks: Sequence[SubdomainBlocks],
    neighbours: Neighbours,
    V: Sequence[Float],
    drop_tolerance: float = DEFAULTS.drop_tolerance,
) -> csr_matrix:
    """(local rows, vectors) U.  Collective.

    Every subdomain adds its part W^-1 B_s D^-1 S_s D^-1 B_s^T W^-1 of M^-1 to the jumps on its rows.  Of large bodies,
    entries below `drop_tolerance`, relative to the largest of their vector, are dropped.
    """
    received, vectors = _exchange_jumps(comm, blocks, neighbours, V)
    U = DenseBlockSum((len(jump_operator.rows), vectors))
    for block, rows, messages in zip(blocks, neighbours.rows, received, strict=True):
        for group in _groups(messages):
            columns = np.concatenate([jumps.columns for jumps in group])
            jump, at = np.zeros((len(rows), len(columns))), 0
            for jumps in group:
                jump[jumps.rows, at : at + len(jumps.columns)] = jumps.values
                at += len(jumps.columns)
            part = block.BW @ block.operator.apply_schur(block.BW.T @ jump)
            if block.facewise:
                U.add_entries_above(rows, columns, part, drop_tolerance * np.abs(part).max(axis=0))
            else:
                U.add(rows, columns, part)
    owned = jump_operator.owned[1] - jump_operator.owned[0]
    return add_shared_rows(comm, U.matrix(), jump_operator.rows, jump_operator.is_shared_row, owned)


def _exchange_jumps(
    comm: MPI.Intracomm, blocks: Sequence[SubdomainBlocks], neighbours: Neighbours, V: Sequence[Float]
) -> tuple[list[list[_Jumps]], int]:
    """For each subdomain of this rank the jumps on its rows, and the number of coarse vectors.  Collective."""
    counts = np.zeros(len(neighbours.rank), np.int64)
    counts[neighbours.index] = [v.shape[1] for v in V]
    comm.Allreduce(MPI.IN_PLACE, counts)
    ends = np.cumsum(counts)

    def messages() -> Iterator[tuple[int, int, tuple[Int, Float]]]:
        for i, (block, v) in enumerate(zip(blocks, V, strict=True)):
            Z, first = block.B @ v, ends[neighbours.index[i]] - v.shape[1]
            for s, common in neighbours.common[i].items():
                nonzero = np.flatnonzero(Z[common].any(axis=0))
                yield i, s, (first + nonzero, Z[np.ix_(common, nonzero)])

    received: list[list[_Jumps]] = [[] for _ in blocks]
    neighbours.exchange(
        messages(),
        lambda i, sender, message: received[i].append(_Jumps(neighbours.common[i][sender], *message)),
    )
    return received, int(ends[-1]) if len(ends) else 0


def _groups(messages: Sequence[_Jumps]) -> Iterator[list[_Jumps]]:
    """The same jumps, at most VECTOR_CHUNK columns at a time."""
    group: list[_Jumps] = []
    width = 0
    for rows, columns, values in messages:
        for first in range(0, len(columns), VECTOR_CHUNK):
            some = slice(first, first + VECTOR_CHUNK)
            if width + len(columns[some]) > VECTOR_CHUNK:
                yield group
                group, width = [], 0
            group.append(_Jumps(rows, columns[some], values[:, some]))
            width += len(columns[some])
    if group:
        yield group
