"""Boundary operators of a subdomain by sparse factorizations, where dense matrices are too large; interiors."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csr_matrix

from feti_homog.feti.decomposition.subdomain import Subdomain
from feti_homog.feti.linalg.sparse_direct import DirectSolver
from feti_homog.feti.thresholds import SPARSE_COLUMNS_AT_ONCE
from feti_homog.typing import Float, Int


@dataclass(frozen=True)
class CondensedLoads:
    """The v unit loads condensed to the n boundary dofs of subdomains.

    Loads vanish inside pieces of one material but for nodes at voids.  With K_ii u_i = -Q_i E - K_ib u_b the stress
    integral is C E + q^T u_b and the forces on the boundary are S u_b + q E, of

        q = Q_b - K_bi K_ii^-1 Q_i,  C = |Omega| L - Q_i^T K_ii^-1 Q_i.

    Attributes:
        boundary: (n, v) q.
        stiffness: (v, v) C, or the sum.
    """

    boundary: Float
    stiffness: Float


class ImplicitInterfaceOperator:
    """S and the boundary part of K+ of one subdomain, on its n boundary dofs."""

    is_dense = False

    def __init__(self, subdomain: Subdomain, K: csr_matrix, dofs: Int) -> None:
        """Factor K + rho Rf Rf^T; `dofs` (n,) are sorted local numbers.  Options under `feti_sub_`."""
        self.n, self.dofs, self._subdomain = len(dofs), dofs, subdomain
        # A single subdomain has no boundary: any of its nodes can be fixed.
        own = subdomain.problem.nodes(dofs)
        nodes = np.unique(own) if len(dofs) else np.arange(subdomain.mesh.n_classes)
        if not len(dofs) and not subdomain.R.shape[1]:
            self.interior = Interior(K, dofs)  # all of it, and no forces come from outside
            return
        self._solver = DirectSolver(subdomain.regularised(K, nodes), "feti_sub_")

    @cached_property
    def interior(self) -> Interior:
        """The interior, factored when first asked for; for that K is assembled again."""
        return Interior(self._subdomain.take_stiffness(), self.dofs)

    @cached_property
    def condensed(self) -> CondensedLoads:
        """The loads, which need the interior where they act inside."""
        s, interior = self._subdomain, self.interior if self._subdomain.loads_inside else None
        if interior is None:
            return CondensedLoads(s.Q[self.dofs], s.area * s.L)
        inside = s.Q[interior.dofs]
        u = interior.solve(-inside)
        return CondensedLoads(s.Q[self.dofs] + interior.coupling @ u, s.area * s.L + inside.T @ u)

    def apply_schur(self, x: Float, out: Float | None = None) -> Float:
        """S x = K_bb x - K_bi K_ii^-1 K_ib x for x (n,) or (n, k), into `out` if it is given."""
        return _by_columns(self.interior.reactions, x, out)

    def apply_flexibility(self, x: Float, out: Float | None = None) -> Float:
        """Return the boundary part of K+ x for x (n,) or (n, k), into `out` if it is given."""
        return _by_columns(self._solve, x, out)

    def _solve(self, x: Float) -> Float:
        """Return the boundary part of K+ x for few columns."""
        load = np.zeros((self._subdomain.n_dofs, *x.shape[1:]), order="F")
        load[self.dofs] = x
        return self._solver.solve(load)[self.dofs]


class Interior:
    """The dofs of one subdomain that no constraint acts on.

    Attributes:
        dofs: their local numbers, sorted.
    """

    def __init__(self, K: csr_matrix, dofs: Int) -> None:
        """Split K and factor K_ii; `dofs` (n,) are the boundary's.  Options under `feti_interior_`."""
        inside = np.ones(K.shape[0], bool)
        inside[dofs] = False
        self.dofs = np.flatnonzero(inside)
        rows = K[self.dofs]
        self._Kib, self._Kbb = rows[:, dofs], K[dofs][:, dofs]
        if len(self.dofs):
            self._solver = DirectSolver(rows[:, self.dofs].tocsr(), "feti_interior_")

    @cached_property
    def coupling(self) -> csr_matrix:
        """(n, inner dofs) K_bi."""
        return self._Kib.T.tocsr()

    def extend(self, x: Float, load: Float | None = None) -> Float:
        """-K_ii^-1 (K_ib x + q): the interior in equilibrium with boundary displacements x (n,) or (n, k).

        The `load` q (inner dofs,) or (inner dofs, k) acts on it if there is one.
        """
        forces = self._Kib @ x
        return self.solve(-forces if load is None else -forces - load)

    def solve(self, forces: Float) -> Float:
        """K_ii^-1 f for forces (inner dofs,) or (inner dofs, k) while the boundary is held."""
        return self._solver.solve(forces) if len(self.dofs) else np.zeros(forces.shape)

    def reactions(self, x: Float) -> Float:
        """S x, the forces that go with boundary displacements x (n,) or (n, k)."""
        return np.asarray(self._Kbb @ x + self.coupling @ self.extend(x))


def _by_columns(apply: Callable[[Float], Float], x: Float, out: Float | None) -> Float:
    """`apply` to at most SPARSE_COLUMNS_AT_ONCE columns of x (n, k) at a time, or to x (n,)."""
    if out is None:
        out = np.empty_like(x)
    if not len(x):
        return out
    if x.size <= SPARSE_COLUMNS_AT_ONCE * len(x):
        out[:] = apply(x)
        return out
    for first in range(0, x.shape[1], SPARSE_COLUMNS_AT_ONCE):
        some = slice(first, first + SPARSE_COLUMNS_AT_ONCE)
        out[:, some] = apply(x[:, some])
    return out
