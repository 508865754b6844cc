"""The present response from the response of the reference cell, by followed columns of the rows C that changed.

With W = s of rows that left (1) or came (-1), and dC of rows whose springs gained compliance, the transforms of
`followed_response` give Gamma_:C B = Gamma'_:C W with the present response Gamma'.  So all other columns, and
answers U, follow from the columns and answers of the reference cell by one product:

    U' = U - Gamma'_:C W U_C,  U 0 before on rows that left or came.
"""

import numpy as np
from mpi4py import MPI

from feti_homog.feti.exact.followed_response import FollowedResponse
from feti_homog.feti.exact.reference_cell import ReferenceCell
from feti_homog.system.parallel import distributed_arrays
from feti_homog.typing import Float, Int


class ReferenceChanges:
    """The rows C of a reference cell that have changed, all of which have followed columns.

    Attributes:
        rows: (c,) C, global numbers.
    """

    def __init__(
        self, comm: MPI.Intracomm, first: int, cell: ReferenceCell, followed: FollowedResponse, rows: Int, kinds: Float
    ) -> None:
        """C are these global `rows` (c,); `kinds` (c, 2) are s, 0 of rows that hold here and there, and dC.

        This rank's rows begin at `first`.
        """
        self._comm, self._first, self._cell, self._followed, self.rows = comm, first, cell, followed, rows
        self._turned, self._more = kinds.T[:, :, None]
        self._weights = np.where(self._turned != 0.0, self._turned, self._more)
        places = rows - first
        self._mine = np.flatnonzero((places >= 0) & (places < len(cell.active)))
        self._own = places[self._mine]

    def present(self, columns: Float) -> Float:
        """(owned rows, k) U' of U (owned rows, k).  Collective."""
        response = columns.copy()
        response[self._own[self._turned[self._mine, 0] != 0.0]] = 0.0
        response -= self._followed.product(self.rows, self._weights * self._gathered(columns))
        return response

    def refined(self, columns: Float) -> Float:
        """`present` without the rounding of followed columns, by one iterative refinement.  Collective.

        c = B U_C obeys (Gamma_CC + D) c = U_C with the reference cell's own Gamma.
        """
        response = self.present(columns)
        values = self._gathered(response)
        c = self._weights * values
        residual = columns - self._cell.respond(self._spread(c))
        # D c of rows that hold in both cells, that came, and that left.
        stretched = np.where(self._turned == 0.0, values, np.where(self._turned < 0.0, -self._more * c, 0.0))
        rest = self._spread(self._gathered(residual) - stretched)
        residual[self._own] = response[self._own]
        return residual + self.present(rest)

    def error(self, rows: Int, columns: Float, stiffness: Float) -> float:
        """Return how far new columns (owned rows, k) of global rows (k,), none of C, are off the followed columns of C.

        Gamma' is symmetric.  Relative to the largest entry, each by its units: `stiffness` (all rows,) on active rows.
        Collective.
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
        """(owned rows, k) these (c, k) on C, 0 elsewhere."""
        x = np.zeros((len(self._cell.active), values.shape[1]))
        x[self._own] = values[self._mine]
        return x
