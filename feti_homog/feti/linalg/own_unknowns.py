"""Elimination of the unknowns of a sum over ranks that one rank alone has: a sparse factor of these."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix

from feti_homog.feti.linalg.remainder import Remainder
from feti_homog.feti.linalg.schur_complement import schur_complement
from feti_homog.feti.linalg.sparse_direct import DirectSolver
from feti_homog.typing import Float, Int


@dataclass(frozen=True)
class OwnUnknowns:
    """The eliminated unknowns I of a rank, and F, which others have too.

    Attributes:
        inner, left: (i,) and (f,) positions of I and F among the rank's unknowns.
        solver: solves with A_II; None if I is empty, or if A_II is not definite.
        coupling: (i, f) A_IF.
        error: why A_II is not definite, if it is not.
    """

    inner: Int
    left: Int
    solver: DirectSolver | None
    coupling: csr_matrix
    error: np.linalg.LinAlgError | None

    def forward(self, right: Float) -> Float:
        """(f, k) what the elimination leaves of right-hand sides (u, k)."""
        rest = right[self.left]
        return rest if self.solver is None or not len(rest) else rest - self.coupling.T @ self._solve(right[self.inner])

    def backward(self, right: Float, x: Float) -> Float:
        """The unknowns (u, k) for right-hand sides (u, k) and those of F, x (f, k)."""
        both = np.empty_like(right)
        both[self.left] = x
        both[self.inner] = self._solve(right[self.inner] - self.coupling @ x)
        return both

    def _solve(self, right: Float) -> Float:
        return right if self.solver is None else self.solver.solve(right)

    def destroy(self) -> None:
        """Free the factor."""
        if self.solver is not None:
            self.solver.destroy()


def eliminate_own(unknowns: Int, copies: Int, part: csr_matrix, prefix: str) -> tuple[OwnUnknowns, Remainder]:
    """Eliminate those of the unknowns (u,) of which there is one copy, `copies` (u,) being how many ranks have each.

    Where their matrix is not definite, what is left is NaN.  Raises CaseError as `DirectSolver`.
    """
    inner, left = np.flatnonzero(copies == 1), np.flatnonzero(copies > 1)
    rows, solver, error = part[inner], None, None
    matrix = np.zeros((len(left), len(left)))
    try:
        solver = DirectSolver(rows[:, inner].tocsr(), prefix) if len(inner) else None
        if len(left):
            matrix[:] = schur_complement(part, left)
    except np.linalg.LinAlgError as caught:
        matrix[:], error = np.nan, caught
    own = OwnUnknowns(inner, left, solver, rows[:, left].tocsr(), error)
    some, once = copies[left], np.ones(len(left), np.int64)
    return own, Remainder(unknowns[left], some, once, np.arange(len(left)), matrix)
