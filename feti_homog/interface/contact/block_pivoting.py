"""Block principal pivoting (Judice & Pires, Computers & Operations Research 21, 1994): which nodes change state.

All wrong nodes change at once while their number falls, else only the first one (Murty's rule).  While no fibre is free
the gaps are q + A p with contact pressures p and a positive definite A, so no set of states comes again and the search
ends.  With free fibres A is semi-definite only, and that is not proven.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from mpi4py import MPI

from feti_homog.typing import Bool


@dataclass
class BlockPivoting:
    """One search.

    Attributes:
        block_pivots: block pivots in a row, counted from the last that left fewer wrong nodes than ever before,
            after which only one node changes at a time; 0 means one at a time from the beginning.
    """

    comm: MPI.Intracomm
    block_pivots: int
    _fewest: float = field(default=np.inf, init=False)
    _left: int = field(default=0, init=False)

    def choose(self, wrong: Bool, count: int) -> Bool:
        """Return the nodes (k,) of this rank that change, of those that are `wrong`, `count` on all ranks.

        Collective.
        """
        self._left -= 1
        if count < self._fewest:
            self._fewest, self._left = count, self.block_pivots
        return wrong if self._left > 0 else self._first(wrong)

    def _first(self, wrong: Bool) -> Bool:
        """Return the first wrong node of the lowest rank that has one."""
        rank = self.comm.allreduce(self.comm.rank if wrong.any() else self.comm.size, MPI.MIN)
        first = np.zeros_like(wrong)
        if rank == self.comm.rank:
            first[np.argmax(wrong)] = True
        return first
