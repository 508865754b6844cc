"""Explicit local operators: dense flexibilities and Schur complements on the boundary dofs of each subdomain.

They cost a solve a boundary dof and pay after some hundred applications, as a debonding path makes.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from feti_homog.feti.constraints import Constraints
from feti_homog.feti.local import LocalSolver
from feti_homog.feti.operator import DualOperator
from feti_homog.feti.subdomain import Subdomain

Int = NDArray[np.int64]
Float = NDArray[np.float64]


class DenseBlocks:
    """y_s = A_s x_s with a dense symmetric A_s for each subdomain of this rank."""

    def __init__(self, blocks: Sequence[Float]) -> None:
        self.blocks = blocks
        self.offsets = np.cumsum([0, *(len(b) for b in blocks)])
        self._y = np.empty(self.offsets[-1])

    def apply(self, x: Float) -> Float:
        """A x; the next call overwrites it."""
        for block, (first, last) in zip(self.blocks, pairwise(self.offsets), strict=True):
            np.dot(block, x[first:last], out=self._y[first:last])
        return self._y


class ExplicitDualOperator(DualOperator):
    """F with the boundary part of every K+ as a dense matrix."""

    def __init__(self, constraints: Constraints, solver: LocalSolver, boundary: Sequence[Int]) -> None:
        super().__init__(constraints, solver)
        own = [solver.offsets[s] + dofs for s, dofs in enumerate(boundary)]
        self._Bb = self.B[:, np.concatenate(own or [np.zeros(0, np.int64)])]
        self._BbT = self._Bb.T.tocsr()
        self.flexibility = DenseBlocks([solver.columns(s, dofs) for s, dofs in enumerate(boundary)])

    def apply(self, x: Float) -> Float:
        """sum_s B K+ B^T x."""
        return self.constraints.sum(self._Bb @ self.flexibility.apply(self._BbT @ self.constraints.gather(x)))


def schur_complements(
    flexibility: DenseBlocks, subdomains: Sequence[Subdomain], boundary: Sequence[Int]
) -> DenseBlocks:
    """S_s = (K+_bb)^-1 - rho Rf Rf^T: the fixing nodes lie on the boundary, so elimination leaves their block."""
    blocks = []
    for block, subdomain, dofs in zip(flexibility.blocks, subdomains, boundary, strict=True):
        S = np.linalg.inv(block)
        fixed, term = subdomain.fixing(np.unique(dofs // 2))
        at = np.searchsorted(dofs, fixed)
        S[np.ix_(at, at)] -= term
        blocks.append((S + S.T) / 2)
    return DenseBlocks(blocks)
