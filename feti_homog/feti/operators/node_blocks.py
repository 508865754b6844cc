"""Matrices on the multipliers that couple only the rows of one fine node, such as B B^T."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI
from scipy.sparse import csr_matrix

from feti_homog.feti.decomposition.jump_operator import JumpOperator
from feti_homog.feti.linalg.distributed_matrix import assemble_owned_rows
from feti_homog.typing import Float, Int


class NodeBlocks:
    """A matrix on the multipliers whose entries couple only rows of one fine node, as small dense blocks.

    Attributes:
        rows: number of rows that this rank owns.
        blocks: for each size k of blocks, the rows (b, k) of the b blocks among the owned ones, and they (b, k, k).
    """

    def __init__(self, comm: MPI.Intracomm, jump_operator: JumpOperator, local: csr_matrix) -> None:
        """Sum `local` (local rows, local rows) over ranks and keep the owned rows.  Collective."""
        first, last = jump_operator.owned
        matrix = assemble_owned_rows(comm, local, jump_operator.rows, jump_operator.rows, (last - first, last - first))
        entries = matrix[:, first:last].tocoo()
        starts, sizes = jump_operator.node_rows
        self.rows = last - first
        self.blocks: list[tuple[Int, Float]] = []
        block = np.repeat(np.arange(len(starts)), sizes)[entries.row]
        for size in np.unique(sizes):
            some = np.flatnonzero(sizes == size)
            number = np.full(len(starts), -1)
            number[some] = np.arange(len(some))
            mine = number[block] >= 0
            own = block[mine]
            dense = np.zeros((len(some), size, size))
            dense[number[own], entries.row[mine] - starts[own], entries.col[mine] - starts[own]] = entries.data[mine]
            self.blocks.append((starts[some][:, None] + np.arange(size), dense))

    def inverse(self, active: Float) -> csr_matrix:
        """(owned rows, owned rows) inverse of the part where `active` (owned rows,) is 1; 0 elsewhere."""
        rows, columns, values = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)], [np.zeros(0)]
        for at, dense in self.blocks:
            mask = active[at]
            both = mask[:, :, None] * mask[:, None, :]
            unit = np.eye(at.shape[1]) * (1 - mask)[:, :, None]
            rows.append(np.broadcast_to(at[:, :, None], dense.shape).ravel())
            columns.append(np.broadcast_to(at[:, None, :], dense.shape).ravel())
            inverse = np.asarray(np.linalg.inv(both * dense + unit), float)
            values.append((both * inverse).ravel())
        shape = (self.rows, self.rows)
        return csr_matrix((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=shape)
