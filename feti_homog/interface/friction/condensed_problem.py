"""A problem of a cell, in the plane or along the fibres, condensed to jumps of some interface rows.

With H the inverse of the dual operator of the bonded cell, prescribed jumps g on rows D leave

    lam = H (d E - g),      |UC| Sigma = L E - b^T g,      b = (H d)_D,

L the bonded stiffness times the area: the cell stores x.S x / 2 of x = (g, E), S = [[H_DD, -b], [-b^T, L]].
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import lu_factor, lu_solve

from feti_homog.errors import CaseError
from feti_homog.feti.dual_solution import DualSolution
from feti_homog.feti.solver_plan import WITHOUT_INVERSE
from feti_homog.interface.contact.contact_problem import ContactProblem
from feti_homog.interface.contact.states import BondState
from feti_homog.interface.friction.status_system import HELD
from feti_homog.system.parallel.distributed_arrays import allreduce_sum, gather_rows
from feti_homog.typing import Float, Int

# Steps by which what is held is let go of again.
REFINEMENTS = 3
# Stiffness, relative to that with all bonds, that is what rounding leaves of none.
NO_STIFFNESS = 1e-10


class CondensedProblem:
    """One problem with the rows that `take` was last given.

    Attributes:
        interface: its contact problem.
        rows: (n,) global rows D.
        first: global number of the first row of this rank.
    """

    def __init__(self, interface: ContactProblem) -> None:
        """Find the response of the bonded cell to its loads.  Collective.

        Raises:
            CaseError: the solver has no inverse of the dual operator.
        """
        self.interface, self.solver = interface, interface.solver
        if self.solver.exact_inverse is None:
            raise CaseError(WITHOUT_INVERSE)
        self._inverse, self.first = self.solver.exact_inverse, self.solver.jump_operator.owned[0]
        self._response = self._inverse.multipliers(self.solver.d, np.eye(len(self.solver.problem.loads)))
        bonded = self.solver.torn_stiffness + allreduce_sum(self.solver.comm, self.solver.d.T @ self._response)
        self._bonded = (bonded + bonded.T) / 2
        self._some: tuple[Int, Float] | None = None

    def take(self, rows: Int, springs: Float) -> tuple[Float, Float, Float]:
        """Return H_DD (n, n) with springs (n,) beside it, b (n, v) and L (v, v) of the same rows.  Collective."""
        self.rows, self._some = rows, None
        self._columns, K = self._inverse.columns(rows)
        K[np.diag_indices(len(K))] += springs
        return K, gather_rows(self.solver.comm, self._response, self.first, rows), self._bonded

    def multipliers(self, jump: Float, strain: Float) -> Float:
        """(owned rows,) lam of jumps (n,) and strains (v,)."""
        return np.asarray(self._response @ strain - self._columns @ jump)

    def some_multipliers(self, own: Int, jump: Float, strain: Float) -> Float:
        """(k, c) lam at the places `own` (k, c) among the owned rows; their columns are kept for this array."""
        if self._some is None or self._some[0] is not own:
            self._some = own, self._columns[own.ravel()]
        return self._response[own] @ strain - (self._some[1] @ jump).reshape(own.shape)

    def solution(self, bonds: BondState, jump: Float, strain: Float) -> DualSolution:
        """Return the multipliers, and the jumps that they leave by the dual operator itself.  Collective."""
        solver, lam = self.solver, self.multipliers(jump, strain)
        torn = solver.d @ strain
        left, opened = torn - solver.operator.apply(lam), np.zeros(len(lam))
        mine = (self.rows >= self.first) & (self.rows < self.first + len(lam))
        opened[self.rows[mine] - self.first] = jump[mine]
        alpha = np.zeros(solver.natural.kernel_dimension)
        if len(alpha):
            alpha -= solver.natural.amplitudes(left - opened)
            left = left + solver.natural.G @ alpha
        sums = np.array([(left - opened) @ (left - opened), left @ left, torn @ torn])
        off, *sizes = np.sqrt(allreduce_sum(solver.comm, sums))
        C = self.interface.compliance(bonds)
        left = left - (C - solver.intact_compliance) * lam
        return DualSolution(strain, lam, left, alpha, 0, 2, float(off / (max(sizes) or 1.0)), C)


class AxialFaces:
    """The axial problem, a few rows and columns of the matrix S of `coulomb_faces` behind those of the plane.

    The jumps g = K^-1 b E are eliminated, K g = b E.  What nothing holds is held by a share of its own row: a share of
    the largest would measure by the stiffest spring.

    Attributes:
        problem: the axial one.
        stiffness: (v, v) of its strains, L - b^T K^-1 b.
    """

    def __init__(self, problem: CondensedProblem, rows: Int, springs: Float) -> None:
        """Take rows (n,) with springs (n,), 0 of faces that nothing ties.  Collective."""
        self.problem = problem
        K, b, L = problem.take(rows, springs)
        held = lu_factor(K + HELD * np.diag(K.diagonal()))
        self._jumps = np.zeros_like(b)
        for _ in range(1 + REFINEMENTS):
            self._jumps += lu_solve(held, b - K @ self._jumps)
        # Stiffness that is rounding beside that with all bonds would carry a load.
        diagonal, stiffness = L.diagonal(), L - b.T @ self._jumps
        roots = np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
        values, vectors = np.linalg.eigh((stiffness + stiffness.T) / (2.0 * np.outer(roots, roots)))
        left = (vectors * np.where(values > NO_STIFFNESS, values, 0.0)) @ vectors.T
        resists = left.diagonal() > NO_STIFFNESS
        self.stiffness = np.asarray(left * np.outer(resists * roots, resists * roots))

    def parts(self, strain: Float) -> tuple[Float, Float]:
        """Return jumps (n,) of strains (v,), and these."""
        return self._jumps @ strain, strain
