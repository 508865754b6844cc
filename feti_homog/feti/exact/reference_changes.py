"""The present response from the response of the reference cell, by followed columns of the changed rows C.

Let W be s on rows that left (1) or came (-1), and dC on rows whose springs gained compliance.  The transforms of
`followed_response` give Gamma_:C B = Gamma'_:C W with the present response Gamma'.  So one product turns the other
columns, and answers U, of the reference cell into present columns and answers:

    U' = U - Gamma'_:C W U_C,  after U is set to 0 on rows that left or came.
"""

import numpy as np
from mpi4py import MPI

from feti_homog.feti.exact.followed_response import FollowedResponse
from feti_homog.feti.exact.reference_cell import ReferenceCell
from feti_homog.system.parallel import distributed_arrays
from feti_homog.typing import Float, Int


class ReferenceChanges:
    """The changed rows C of a reference cell, which all have followed columns.

    Attributes:
        rows: (c,) global numbers of C.
    """

    def __init__(
        self, comm: MPI.Intracomm, first: int, cell: ReferenceCell, followed: FollowedResponse, rows: Int, kinds: Float
    ) -> None:
        """Store C, the global `rows` (c,), and `kinds` (c, 2): s and dC of each row.

        s is 0 for rows that are active in both cells.  The first owned row is `first`.
        """
        self._comm, self._first, self._cell, self._followed, self.rows = comm, first, cell, followed, rows
        self._turned, self._more = kinds.T[:, :, None]
        self._weights = np.where(self._turned != 0.0, self._turned, self._more)
        places = rows - first
        self._mine = np.flatnonzero((places >= 0) & (places < len(cell.active)))
        self._own = places[self._mine]

    def present(self, columns: Float) -> Float:
        """Compute U' (owned rows, k) from U (owned rows, k).  Collective."""
        response = columns.copy()
        response[self._own[self._turned[self._mine, 0] != 0.0]] = 0.0
        response -= self._followed.product(self.rows, self._weights * self._gathered(columns))
        return response

    def refined(self, columns: Float) -> Float:
        """Compute `present` without rounding of followed columns, by one iterative refinement.  Collective.

        c = B U_C solves (Gamma_CC + D) c = U_C with Gamma of the reference cell.
        """
        response = self.present(columns)
        values = self._gathered(response)
        c = self._weights * values
        residual = columns - self._cell.respond(self._spread(c))
        # D c on rows that are active in both cells, that came, and that left.
        stretched = np.where(self._turned == 0.0, values, np.where(self._turned < 0.0, -self._more * c, 0.0))
        rest = self._spread(self._gathered(residual) - stretched)
        residual[self._own] = response[self._own]
        return residual + self.present(rest)

    def error(self, rows: Int, columns: Float, stiffness: Float) -> float:
        """Compute the asymmetry of new columns (owned rows, k) and followed columns of C.  Collective.

        Gamma' is symmetric.  The new columns belong to global rows (k,), none of C.  The error is relative to the
        largest entry, after `stiffness` (all rows,) of active rows has removed the units.
        """
        entries, followed = self._gathered(columns), self._followed.entries(rows, self.rows).T
        holds = (
            self._turned[:, 0] <= 0.0,
            distributed_arrays.gather_rows(self._comm, self._cell.active, self._first, rows) > 0.0,
        )
        pairs = zip(holds, (np.sqrt(stiffness[some]) for some in (self.rows, rows)), strict=True)
        units = np.multiply.outer(*(np.where(is_active, 1.0 / root, root) for is_active, root in pairs))
        error, largest = (np.abs(units * x).max(initial=0.0) for x in (entries - followed, entries))
        return float(self._comm.bcast(error / max(largest, 1.0)))

    def _gathered(self, x: Float) -> Float:
        return distributed_arrays.gather_rows(self._comm, x, self._first, self.rows)

    def _spread(self, values: Float) -> Float:
        """Scatter values (c, k) on C to owned rows (owned rows, k); other rows are 0."""
        x = np.zeros((len(self._cell.active), values.shape[1]))
        x[self._own] = values[self._mine]
        return x
