"""Boundary operators of a subdomain by sparse factorizations: for boundaries too large for dense matrices."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from feti_homog.feti.local import LocalSolver
from feti_homog.feti.subdomain import Subdomain

Int = NDArray[np.int64]
Float = NDArray[np.float64]


class Factored:
    """S and the boundary part of K+ of one subdomain, on its n boundary dofs."""

    def __init__(self, subdomain: Subdomain, dofs: Int) -> None:
        """Factor K + rho Rf Rf^T; `dofs` (n,) are sorted local numbers."""
        self.dofs, self._subdomain = dofs, subdomain
        # A single subdomain has no boundary: any of its nodes can be fixed.
        nodes = np.unique(dofs // 2) if len(dofs) else np.arange(subdomain.mesh.n_classes)
        self.solver = LocalSolver([subdomain.regularised(nodes)], "feti_sub_")

    @cached_property
    def interior(self) -> Interior:
        """The interior, factored when first asked for."""
        interior = Interior(self._subdomain, self.dofs)
        self._subdomain.release()
        return interior

    def stiffness(self, x: Float, out: Float) -> None:
        """S x = K_bb x - K_bi K_ii^-1 K_ib x for x (n,) or (n, k)."""
        out[:] = self.interior.Kbb @ x + self.interior.Kib.T @ self.interior.extend(x)

    def flexibility(self, x: Float, out: Float) -> None:
        """The boundary part of K+ x for x (n,) or (n, k)."""

        def solve(column: Float) -> Float:
            self.solver.b[:] = 0.0
            self.solver.b[self.dofs] = column
            return self.solver.solve()[self.dofs]

        out[:] = by_column(solve, x)


class Interior:
    """The dofs of one subdomain that no constraint acts on."""

    def __init__(self, subdomain: Subdomain, dofs: Int) -> None:
        """Split K and factor K_ii; `dofs` (n,) are the boundary's."""
        inside = np.ones(subdomain.K.shape[0], bool)
        inside[dofs] = False
        self.dofs = np.flatnonzero(inside)
        rows = subdomain.K[self.dofs]
        self.Kib, self.Kbb = rows[:, dofs], subdomain.K[dofs][:, dofs]
        self._solver = LocalSolver([rows[:, self.dofs].tocsr()], "feti_interior_")

    def extend(self, x: Float) -> Float:
        """-K_ii^-1 K_ib x: the interior in equilibrium with boundary displacements x (n,) or (n, k)."""

        def solve(column: Float) -> Float:
            self._solver.b[:] = column
            return self._solver.solve().copy()

        return by_column(solve, -self.Kib @ x) if len(self.dofs) else np.zeros((0, *x.shape[1:]))


def by_column(solve: Callable[[Float], Float], x: Float) -> Float:
    """`solve` for x (n,), or for each column of x (n, k)."""
    if x.ndim == 1:
        return solve(x)
    return np.stack([solve(column) for column in x.T], axis=1)
