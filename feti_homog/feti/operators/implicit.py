"""Boundary operators of a subdomain by sparse factorizations: for boundaries too large for dense matrices."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np

from feti_homog.feti.decomposition.subdomain import Subdomain
from feti_homog.feti.linalg.sparse_direct import DirectSolver
from feti_homog.typing import Float, Int

# Columns that are solved for at once, so that memory stays bounded.
CHUNK = 64


class ImplicitInterfaceOperator:
    """S and the boundary part of K+ of one subdomain, on its n boundary dofs."""

    def __init__(self, subdomain: Subdomain, dofs: Int) -> None:
        """Factor K + rho Rf Rf^T; `dofs` (n,) are sorted local numbers.  Options under `feti_sub_`."""
        self.n, self.dofs, self._subdomain = len(dofs), dofs, subdomain
        # A single subdomain has no boundary: any of its nodes can be fixed.
        nodes = np.unique(dofs // 2) if len(dofs) else np.arange(subdomain.mesh.n_classes)
        self._size = subdomain.K.shape[0]
        self._solver = DirectSolver(subdomain.regularised(nodes), "feti_sub_")

    @cached_property
    def interior(self) -> Interior:
        """The interior, factored when first asked for."""
        interior = Interior(self._subdomain, self.dofs)
        self._subdomain.release()
        return interior

    def stiffness(self, x: Float, out: Float) -> None:
        """S x = K_bb x - K_bi K_ii^-1 K_ib x for x (n,) or (n, k)."""
        out[:] = self.forces(x)

    def flexibility(self, x: Float, out: Float) -> None:
        """The boundary part of K+ x for x (n,) or (n, k)."""
        out[:] = self.answer(x)

    def answer(self, X: Float) -> Float:
        """The boundary part of K+ X for X (n,) or (n, k)."""

        def solve(part: Float) -> Float:
            load = np.zeros((self._size, *part.shape[1:]), order="F")
            load[self.dofs] = part
            return self._solver.solve(load)[self.dofs]

        return _by_chunks(solve, X)

    def forces(self, X: Float) -> Float:
        """S X for X (n,) or (n, k)."""
        return _by_chunks(self.interior.reactions, X)


class Interior:
    """The dofs of one subdomain that no constraint acts on."""

    def __init__(self, subdomain: Subdomain, dofs: Int) -> None:
        """Split K and factor K_ii; `dofs` (n,) are the boundary's.  Options under `feti_interior_`."""
        inside = np.ones(subdomain.K.shape[0], bool)
        inside[dofs] = False
        self.dofs = np.flatnonzero(inside)
        rows = subdomain.K[self.dofs]
        self._Kib, self._Kbb = rows[:, dofs], subdomain.K[dofs][:, dofs]
        if len(self.dofs):
            self._solver = DirectSolver(rows[:, self.dofs].tocsr(), "feti_interior_")

    def extend(self, x: Float) -> Float:
        """-K_ii^-1 K_ib x: the interior in equilibrium with boundary displacements x (n,) or (n, k)."""
        return self._solver.solve(-self._Kib @ x) if len(self.dofs) else np.zeros((0, *x.shape[1:]))

    def reactions(self, x: Float) -> Float:
        """S x, the forces that hold boundary displacements x (n,) or (n, k)."""
        return np.asarray(self._Kbb @ x + self._Kib.T @ self.extend(x))


def _by_chunks(apply: Callable[[Float], Float], X: Float) -> Float:
    """`apply` to some columns at a time."""
    if X.size <= CHUNK * len(X):
        return apply(X)
    Y = np.empty_like(X)
    for first in range(0, X.shape[1], CHUNK):
        some = slice(first, first + CHUNK)
        Y[:, some] = apply(X[:, some])
    return Y
