"""A reference cell whose rows have changed: its response by the columns of these.

See `exact_inverse` for the equations.
"""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from feti_homog.feti.exact.bordered_inverse import BorderedInverse
from feti_homog.feti.exact.reference_cell import ReferenceCell, ResponseColumns
from feti_homog.feti.linalg.dense_matrices import product_with_some
from feti_homog.system.parallel.distributed_arrays import gather_rows, scale_rows
from feti_homog.typing import Float, Int


class ChangedReference:
    """A reference cell, columns of its response, and N of the rows that have changed.

    Attributes:
        cell: the reference cell.
        columns: those of its response that were found.
        inverse: N.
    """

    def __init__(self, comm: MPI.Intracomm, cell: ReferenceCell, owned: tuple[int, int], stiffness: Float) -> None:
        """No columns yet; this rank owns the rows from owned[0] up to owned[1].

        `stiffness` (all rows,) is the most that the diagonal of Gamma can be on active rows.
        """
        self._comm, self._first, self._rows, self._stiffness = comm, owned[0], owned[1] - owned[0], stiffness
        self.cell, self.columns = cell, ResponseColumns(comm, cell, owned, len(stiffness))
        self.inverse = BorderedInverse(comm)

    def destroy(self) -> None:
        """Free the cell and the columns."""
        self.cell.destroy()
        self.columns.clear()

    def update(self, changed: Int, softened: Float) -> None:
        """Let N be that of the global rows `changed`, which have columns; D is `softened` (owned rows,).

        It is made anew where updates have lost too many digits.  Collective.
        """
        at, ours = self.columns.positions(changed), np.stack([self.cell.active, softened], axis=1)
        active, D = gather_rows(self._comm, ours, self._first, changed).T
        columns = self.columns.block, self._stiffness[self.columns.rows]
        self.inverse.exchange(*columns, at, active == 0, D)
        if not self.inverse.holds():
            self.inverse = BorderedInverse(self._comm)
            self.inverse.exchange(*columns, at, active == 0, D)

    def response(self, z: Float) -> Float:
        """(owned rows,[ k]) H g on active rows, what of g is left on others; z = Gamma g_A + g_R.  Collective."""
        members, z = self.inverse.members, z.copy()
        if len(members):
            rows = self.columns.rows[members]
            c = self.inverse.solve(gather_rows(self._comm, z, self._first, rows))
            z -= product_with_some(self.columns.owned, members, c)
            mine = np.flatnonzero((rows >= self._first) & (rows < self._first + self._rows))
            own = rows[mine] - self._first
            # A row that left opens by c, one that came bears -c.  Nothing cancels in D c, however soft the spring.
            stretched = self.inverse.added[mine]
            outside = self.cell.active[own] == 0.0
            factor = np.where(outside, -1.0, np.where(stretched > 0, stretched, 1.0))
            z[own] = scale_rows(factor, c[mine])
        return z

    def present(self, rows: Int, active: Float) -> Float:
        """(owned rows, k) columns, of the cell with the `active` rows (owned rows,) that N is of, of rows (k,).

        They have columns.  Collective.
        """
        both = np.stack([active, self.cell.active], axis=1)
        turned = -np.diff(gather_rows(self._comm, both, self._first, rows)).ravel()
        columns = self.columns.owned[:, self.columns.positions(rows)]
        columns[:, turned != 0.0] = 0.0
        mine = np.flatnonzero((turned != 0.0) & (rows >= self._first) & (rows < self._first + self._rows))
        columns[rows[mine] - self._first, mine] = turned[mine]
        return self.response(columns)
