"""Direct solves with the sum over ranks of sparse parts, by elimination on a tree of ranks.

A rank eliminates the unknowns that it alone has.  Then ranks meet, and where two groups meet, the unknowns that no rank
of a third has are eliminated, until none is left: the multifrontal method (Duff & Reid, ACM TOMS 9, 1983) in the order
of a nested dissection (George, SIAM J. Numer. Anal. 10, 1973) whose domains are the ranks.  No rank has more than its
own unknowns, and its share of those on the borders of the groups in which it is.
"""

from __future__ import annotations

import numpy as np
from mpi4py import MPI
from scipy.sparse import csr_matrix

from feti_homog.feti.linalg.fronts import Front
from feti_homog.feti.linalg.own_unknowns import eliminate_own
from feti_homog.feti.linalg.rank_tree import RankTree, copies
from feti_homog.feti.linalg.shared_fronts import meet
from feti_homog.feti.thresholds import FRONT_BLOCK
from feti_homog.parallel.mpi_errors import agree
from feti_homog.typing import Float, Int


class TreeElimination:
    """X = A^-1 B for a matrix A (n, n) of which each rank has a part, on the unknowns that it has.

    Attributes:
        fronts: of the meetings of this rank.
    """

    def __init__(
        self, tree: RankTree, total: int, unknowns: Int, part: csr_matrix, prefix: str, block: int = FRONT_BLOCK
    ) -> None:
        """Eliminate all unknowns.  Options under `prefix` are for those that one rank alone has (default: cholesky by
        CHOLMOD), under `feti_schur_` for what they leave.  Collective.

        Args:
            total: n.
            unknowns: (u,) numbers of those of this rank, ascending; several ranks may have one.
            part: (u, u) this rank's part.
            block: columns of large fronts that a rank gets at once.

        Raises:
            LinAlgError: the matrix is not positive definite; on all ranks.
            CaseError: the library that the options name has no such factorization.
        """
        counts = copies(tree.comm, total, unknowns)
        self._own, remainder = agree(tree.comm, eliminate_own, unknowns, counts, part, prefix)
        self.fronts: list[Front] = []
        for meeting in tree.meetings:
            front, remainder = meet(meeting, remainder, block)
            self.fronts.append(front)
        is_definite = self._own.error is None and all(front.is_definite for front in self.fronts)
        if not tree.comm.allreduce(is_definite, MPI.LAND):
            self.destroy()
            words = self._own.error or "not positive definite"
            raise np.linalg.LinAlgError(f"a coarse matrix is singular: {words}") from self._own.error

    def solve(self, B: Float) -> Float:
        """A^-1 times the sum over ranks of right-hand sides, of which each rank has a part B (u,) or (u, k), on the
        unknowns of this rank.  Collective."""
        right, kept = B if B.ndim == 2 else B[:, None], []
        left = self._own.forward(right)
        for front in self.fronts:
            y, left = front.forward(left)
            kept.append(y)
        for front, y in zip(reversed(self.fronts), reversed(kept), strict=True):
            left = front.backward(y, left)
        return self._own.backward(right, left).reshape(B.shape)

    def destroy(self) -> None:
        """Free the factors.  Collective."""
        self._own.destroy()
        for front in self.fronts:
            front.destroy()
        self.fronts.clear()
