"""Saddle-point systems of coarse problems: E c + K^T a = f, K c = g."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc
from scipy.sparse import bmat, csr_matrix, diags

from feti_homog.feti.local import DirectSolver, IndefiniteSolver

Float = NDArray[np.float64]

# Of the constraints in the augmented matrix; each solve with it shrinks their error by about this factor.
WEIGHT = 1e7
# Relative residual that a coarse solve must reach, for T takes away nearly all of what it is applied to where materials
# differ much; and the most solves that may be made to reach it.
ACCURATE = 1e-13
MOST_SOLVES = 4


class SaddlePoint:
    """c and a for symmetric E (n, n), definite on the kernel of K (m, n), whose rows may depend on each other.

    The unknowns are scaled to a unit diagonal of E and unit rows of K.
    """

    def __init__(self, E: csr_matrix, K: csr_matrix, free: csr_matrix, prefix: str) -> None:
        """Factor.  `free` (m, m) is a projector to all a with K^T a = 0; options under `prefix`.

        Raises:
            LinAlgError: the matrix is singular.
        """
        self._columns = 1.0 / np.sqrt(E.diagonal())
        K = K @ diags(self._columns)
        length = np.sqrt(np.asarray(K.multiply(K).sum(axis=1)).ravel())
        self._rows = 1.0 / np.where(length > 0, length, 1.0)
        self._E = (diags(self._columns) @ E @ diags(self._columns)).tocsr()
        self._K = (diags(self._rows) @ K).tocsr()
        self._KT = self._K.T.tocsr()
        self._solves = 2
        self._inner: _Augmented | _Indefinite
        try:
            self._inner = _Augmented(self._E, self._K, prefix)
            accurate = self._refine()
        except PETSc.Error:
            accurate = False
        if not accurate:
            self._solves = 2
            try:
                self._inner = _Indefinite(self._E, self._K, free, prefix)
            except PETSc.Error as error:
                raise np.linalg.LinAlgError(f"a coarse matrix is singular: {error}") from error

    def solve(self, f: Float, g: Float) -> tuple[Float, Float]:
        """c and a for f (n,) and g (m,), or (n, k) and (m, k)."""
        columns, rows = (s if f.ndim == 1 else s[:, None] for s in (self._columns, self._rows))
        c, a = self._solve(columns * f, rows * g)
        return columns * c, rows * a

    def _solve(self, f: Float, g: Float) -> tuple[Float, Float]:
        c, a = self._inner.solve(f, g)
        for _ in range(self._solves - 1):
            dc, da = self._inner.solve(f - self._E @ c - self._KT @ a, g - self._K @ c)
            c, a = c + dc, a + da
        return c, a

    def _refine(self) -> bool:
        """Make as many solves as it takes; whether that was enough."""
        while self._error() > ACCURATE:
            self._solves += 1
            if self._solves > MOST_SOLVES:
                return False
        return True

    def _error(self) -> float:
        """Relative residual of some system."""
        c, a = (np.cos(np.arange(n) + 1.0) for n in self._KT.shape)
        f, g = self._E @ c + self._KT @ a, self._K @ c
        c, a = self._solve(f, g)
        left = (f - self._E @ c - self._KT @ a, g - self._K @ c)
        return float(max(np.linalg.norm(r) / (np.linalg.norm(b) or 1.0) for r, b in zip(left, (f, g), strict=True)))


class _Augmented:
    """By E + rho K^T K, definite: a step of the augmented Lagrangian (Fortin & Glowinski, 1983).

    For columns that overlap widely K^T K has no entry that E has not, so this costs a quarter of an indefinite factor.
    """

    def __init__(self, E: csr_matrix, K: csr_matrix, prefix: str) -> None:
        self._K, self._KT = K, K.T.tocsr()
        self._solver = DirectSolver((E + WEIGHT * (self._KT @ K)).tocsr(), prefix)

    def solve(self, f: Float, g: Float) -> tuple[Float, Float]:
        c = self._solver.solve(f + WEIGHT * (self._KT @ g))
        return c, WEIGHT * (self._K @ c - g)


class _Indefinite:
    """By an LDL^T factor of the whole, for matrices that are too badly conditioned for the other."""

    def __init__(self, E: csr_matrix, K: csr_matrix, free: csr_matrix, prefix: str) -> None:
        self._solver = IndefiniteSolver(bmat([[E, K.T], [K, -free]]).tocsr(), prefix)

    def solve(self, f: Float, g: Float) -> tuple[Float, Float]:
        x = self._solver.solve(np.concatenate([f, g]))
        return x[: len(f)], x[len(f) :]
