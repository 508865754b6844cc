"""The present response Gamma' from the reference cell's Gamma, by followed columns of the changed rows C.

Let W be diagonal, with s = 1 on rows that became inactive, s = -1 on rows that became active, and dC on other rows,
where springs gained the compliance dC.  The transforms of `followed_response` give Gamma_:C B = Gamma'_:C W.  So a
column or an answer U of the reference cell becomes the present column or answer

    U' = U_0 - Gamma'_:C W U_C,  where U_0 is U with 0 on rows that became inactive or active.
"""

import numpy as np
from mpi4py import MPI

from feti_homog.feti.exact.followed_response import FollowedResponse
from feti_homog.feti.exact.reference_cell import ReferenceCell
from feti_homog.system.parallel import distributed_arrays
from feti_homog.typing import Float, Int


class ReferenceChanges:
    """The changed rows C of a reference cell; all of C must have followed columns.

    Attributes:
        rows: (c,) global numbers of C.
    """

    def __init__(
        self, comm: MPI.Intracomm, first: int, cell: ReferenceCell, followed: FollowedResponse, rows: Int, kinds: Float
    ) -> None:
        """Store the global `rows` (c,) of C, with s and dC in `kinds` (c, 2).

        s is 0 on rows that are active in both cells.  The owned rows begin at `first`.
        """
        self._comm, self._first, self._cell, self._followed, self.rows = comm, first, cell, followed, rows
        self._signs, self._more = kinds.T[:, :, None]
        self._weights = np.where(self._signs != 0.0, self._signs, self._more)
        places = rows - first
        self._mine = np.flatnonzero((places >= 0) & (places < len(cell.active)))
        self._places = places[self._mine]

    def present(self, columns: Float) -> Float:
        """Compute U' = U_0 - Gamma'_:C W U_C (owned rows, k) for U = `columns` (owned rows, k).  Collective."""
        response = columns.copy()
        response[self._places[self._signs[self._mine, 0] != 0.0]] = 0.0
        response -= self._followed.product(self.rows, self._weights * self._gathered(columns))
        return response

    def refined(self, columns: Float) -> Float:
        """Compute U' like `present`, with one step of iterative refinement.  Collective.

        The step removes the rounding of followed columns.  c = B U_C solves (Gamma_CC + D) c = U_C with Gamma of the
        reference cell; D is diagonal.
        """
        response = self.present(columns)
        values = self._gathered(response)
        c = self._weights * values
        residual = columns - self._cell.respond(self._spread(c))
        # D c on rows that are active in both cells, that became active, and that became inactive.
        D_c = np.where(self._signs == 0.0, values, np.where(self._signs < 0.0, -self._more * c, 0.0))
        correction = self._spread(self._gathered(residual) - D_c)
        residual[self._places] = response[self._places]
        return residual + self.present(correction)

    def error(self, rows: Int, columns: Float, stiffness: Float) -> float:
        """Compute the largest asymmetry of new columns against followed columns.  Collective.

        Gamma' is symmetric.  The error is relative to the largest entry, at least 1; `stiffness` (all rows,) makes all
        entries dimensionless.  The new `columns` (owned rows, k) belong to global `rows` (k,) outside C.
        """
        entries, followed = self._gathered(columns), self._followed.entries(rows, self.rows).T
        active = distributed_arrays.gather_rows(self._comm, self._cell.active, self._first, rows) > 0.0
        root, root_of_C = np.sqrt(stiffness[rows]), np.sqrt(stiffness[self.rows])
        unit_of_C = np.where(self._signs[:, 0] <= 0.0, 1.0 / root_of_C, root_of_C)
        units = np.multiply.outer(unit_of_C, np.where(active, 1.0 / root, root))
        error, largest = (np.abs(units * x).max(initial=0.0) for x in (entries - followed, entries))
        return float(self._comm.bcast(error / max(largest, 1.0)))

    def _gathered(self, x: Float) -> Float:
        """Gather the rows C of x (owned rows, k) on every rank: (c, k).  Collective."""
        return distributed_arrays.gather_rows(self._comm, x, self._first, self.rows)

    def _spread(self, values: Float) -> Float:
        """Return x (owned rows, k) with `values` (c, k) on the rows C, and 0 on all other rows."""
        x = np.zeros((len(self._cell.active), values.shape[1]))
        x[self._places] = values[self._mine]
        return x
