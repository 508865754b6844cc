"""The matrix E = U^T (F + C) U of coarse vectors U, kept up to date while rows leave and come back.

    E = sum_s X_s^T S_s+ X_s + U^T C U,  X_s = B_s^T U on the active rows.

Each subdomain keeps Y_s = S_s+ X_s, so that a row that leaves costs only the subdomains which it glues, and no solve is
needed for U^T F z = sum_s Y_s^T B_s^T z.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.sparse import csr_matrix, diags

from feti_homog.common.distributed_arrays import scale_rows
from feti_homog.feti.coarse.local_eigenproblems import SubdomainBlocks
from feti_homog.feti.decomposition.jump_operator import JumpOperator
from feti_homog.feti.linalg.dense_block_sum import DenseBlockSum
from feti_homog.feti.operators.interface_operators import InterfaceOperators
from feti_homog.typing import Float, Int


class CoarseOperator:
    """This rank's part of E.

    Attributes:
        U_local: (local rows, vectors) the coarse vectors, whatever rows are active.
        U: (owned rows, vectors) those of its rows that this rank owns.
    """

    def __init__(
        self,
        jump_operator: JumpOperator,
        operators: InterfaceOperators,
        blocks: Sequence[SubdomainBlocks],
        rows: Sequence[Int],
        U_local: csr_matrix,
        compliance: Float,
    ) -> None:
        """For all rows active; `rows` are the local rows of each of the `blocks`, `compliance` (owned rows,) is C."""
        self._jump_operator, self._operators = jump_operator, operators
        self._blocks, self._rows = blocks, rows
        self._mask = np.ones(len(jump_operator.rows))
        self._compliance, self._active = compliance, np.ones(len(compliance))
        # Of each subdomain: the nonzero columns of X_s, and Y_s (boundary dofs, columns) there.
        self._flexed: list[tuple[Int, Float]]
        self._of_bodies: csr_matrix
        self.set_vectors(U_local)

    @property
    def E(self) -> csr_matrix:
        """(vectors, vectors) this rank's part of E on the active rows."""
        if not self._compliance.any():
            return self._of_bodies
        return self._of_bodies + self.U.T @ diags(self._active * self._compliance) @ self.U

    @property
    def vectors(self) -> int:
        """Number of coarse vectors."""
        return int(self.U_local.shape[1])

    def set_vectors(self, U_local: csr_matrix) -> None:
        """Let the columns of U (local rows, vectors) be the coarse vectors."""
        self.U_local, self.U = U_local, self._owned_rows(U_local)
        E = DenseBlockSum((self.vectors, self.vectors))
        self._flexed = []
        for i, block in enumerate(self._blocks):
            columns, X = self._loads(i)
            Y = block.operator.apply_flexibility(X)
            self._flexed.append((columns, Y))
            E.add(columns, columns, X.T @ Y)
        self._of_bodies = E.matrix()

    def activate(self, active: Float) -> None:
        """Update E for the owned rows of which `active` is 1.  Collective."""
        mask = self._jump_operator.gather(active).copy()
        changed = mask != self._mask
        touched = [i for i, rows in enumerate(self._rows) if changed[rows].any()]
        change = DenseBlockSum(self._of_bodies.shape)
        for i in touched:
            columns, X = self._loads(i)
            change.add(columns, columns, -X.T @ self._flexed[i][1])
        self._mask = mask
        for i in touched:
            columns, X = self._loads(i)
            self._flexed[i] = columns, self._blocks[i].operator.apply_flexibility(X)
            change.add(columns, columns, X.T @ self._flexed[i][1])
        self._of_bodies, self._active = self._of_bodies + change.matrix(), active

    def energy(self, z: Float) -> Float:
        """This rank's part of U^T F z, (vectors,) or (vectors, k), for z (owned rows,) or (owned rows, k)."""
        x = self._operators.BT @ self._jump_operator.gather(z)
        energy = np.zeros((self.vectors, *z.shape[1:]))
        for (columns, Y), span in zip(self._flexed, self._operators.slices, strict=True):
            energy[columns] += Y.T @ x[span]
        return np.asarray(energy + self.U.T @ scale_rows(self._compliance, z))

    def _loads(self, i: int) -> tuple[Int, Float]:
        """X_s = B_s^T U of subdomain i on the active rows: its nonzero columns, and (boundary dofs, columns)."""
        rows = self._rows[i]
        columns, dense = _nonzero_columns(self.U_local, rows)
        return columns, self._blocks[i].B.T @ (self._mask[rows, None] * dense)

    def _owned_rows(self, local: csr_matrix) -> csr_matrix:
        """The owned of the local rows, which follow each other; no copy."""
        first, last = self._jump_operator.owned
        at = np.searchsorted(self._jump_operator.rows, first)
        ends = local.indptr[at : at + last - first + 1]
        part = slice(ends[0], ends[-1])
        entries = local.data[part], local.indices[part], ends - ends[0]
        return csr_matrix(entries, shape=(last - first, local.shape[1]))


def _nonzero_columns(matrix: csr_matrix, rows: Int) -> tuple[Int, Float]:
    """Some rows as a dense matrix: its nonzero columns (c,), and their values (rows, c)."""
    part = matrix[rows]
    nonzero = np.zeros(part.shape[1], bool)
    nonzero[part.indices] = True
    columns, number = np.flatnonzero(nonzero), np.cumsum(nonzero) - 1
    dense = np.zeros((len(rows), len(columns)))
    dense[np.repeat(np.arange(len(rows)), np.diff(part.indptr)), number[part.indices]] = part.data
    return columns, dense
