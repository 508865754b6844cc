"""Dense boundary operators of a subdomain: its Schur complement S and the flexibility S+.

Both are symmetric and share one square array, so that a product reads n^2 / 2 numbers.  S comes from one partial
factorization (MUMPS) whose factors are not kept: all that the dual problem needs lives on the boundary, since the load
of a macroscopic strain vanishes inside a uniform body.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg.blas import dsymm, dsymv
from scipy.sparse import csr_matrix

from feti_homog.feti.decomposition.subdomain import Subdomain
from feti_homog.feti.linalg.dense_cholesky import full_from_lower, invert_upper
from feti_homog.feti.linalg.schur_complement import schur_complement, schur_complement_with_loads
from feti_homog.feti.operators.implicit import CondensedLoads
from feti_homog.feti.thresholds import DENSE_COLUMNS_ONE_BY_ONE, ILL_CONDITIONED, INCOMPRESSIBLE_SHARE
from feti_homog.typing import Float, Int


class ExplicitInterfaceOperator:
    """S and S+ of one subdomain on its n boundary dofs, and its unit loads there, `condensed`.

    With the fixing nodes on the boundary, the inverse of S + rho Rf Rf^T is the boundary part of K+.
    """

    is_dense = True

    def __init__(self, subdomain: Subdomain, K: csr_matrix, dofs: Int) -> None:
        """Condense K (2c, 2c) to `dofs` (n,), which are sorted local numbers.  Options under `feti_schur_`.

        Raises:
            LinAlgError: the Schur complement is not positive definite on the complement of the kernel.
        """
        fixed, self._term = subdomain.fixing(K, np.unique(subdomain.problem.nodes(dofs)))
        self._fixed = np.searchsorted(dofs, fixed)
        self.n = len(dofs)
        s, q, C = subdomain, subdomain.Q[dofs], subdomain.area * subdomain.L
        if s.loads_inside:
            both, q, condensed = schur_complement_with_loads(K, dofs, s.Q)
            C = C + condensed
        else:
            both = schur_complement(K, dofs)
        self.condensed = CondensedLoads(q, C)
        self._schur_diagonal = both.diagonal().copy()
        # S stays below the diagonal; the inverse of the regularised S comes above it.
        both[np.ix_(self._fixed, self._fixed)] += np.triu(self._term)
        try:
            invert_upper(both)
        except np.linalg.LinAlgError as error:
            raise np.linalg.LinAlgError(f"the regularised Schur complement of a subdomain: {error}") from error
        self._flexibility_diagonal = both.diagonal().copy()
        # Each diagonal has less than the norm of its matrix.
        conditioning = self._schur_diagonal.max(initial=0.0) * self._flexibility_diagonal.max(initial=0.0)
        is_thin = subdomain.is_thin and bool(conditioning > ILL_CONDITIONED)
        self._refines = is_thin or subdomain.compressible_share < INCOMPRESSIBLE_SHARE
        np.fill_diagonal(both, 0.0)
        self._both = both

    def apply_schur(self, x: Float, out: Float | None = None) -> Float:
        """S x for x (n,) or (n, k), into `out` if it is given; else in Fortran order."""
        return self._product(x, out, self._schur_diagonal, lower=1)

    def apply_flexibility(self, x: Float, out: Float | None = None) -> Float:
        """S+ x for x (n,) or (n, k), into `out` if it is given; else in Fortran order.

        Of a body whose inverse is ill-conditioned, thin or nearly incompressible, with one step of iterative
        refinement.
        """
        y = self._product(x, out, self._flexibility_diagonal, lower=0)
        if self._refines:
            left = x - self.apply_schur(y)
            left[self._fixed] -= self._term @ y[self._fixed]
            y += self._product(left, None, self._flexibility_diagonal, lower=0)
        return y

    def _product(self, x: Float, out: Float | None, diagonal: Float, lower: int) -> Float:
        """Return the symmetric matrix of one triangle of the array, and of a diagonal, times x.

        Fastest in Fortran order.
        """
        A = self._both
        if out is None:
            out = np.empty(x.shape, order="F")
        if x.size > DENSE_COLUMNS_ONE_BY_ONE * self.n:
            own = np.multiply(diagonal[:, None], x, order="F")
            out[:] = dsymm(1.0, A, x, beta=1.0, c=own, overwrite_c=1, lower=lower)
        else:
            for column, result in zip(x.reshape(self.n, -1).T, out.reshape(self.n, -1).T, strict=True):
                np.multiply(diagonal, column, out=result)
                result[:] = dsymv(1.0, A, column, beta=1.0, y=result, overwrite_y=1, lower=lower)
        return out

    @property
    def S(self) -> Float:
        """(n, n) S."""
        S = full_from_lower(self._both)
        np.fill_diagonal(S, self._schur_diagonal)
        return S

    @property
    def regularised_schur(self) -> Float:
        """(n, n) S + rho Rf Rf^T, positive definite; see `Subdomain.fixing`."""
        S = self.S
        S[np.ix_(self._fixed, self._fixed)] += self._term
        return S

    def regularisation(self, P: csr_matrix) -> Float:
        """(m, m) P^T rho Rf Rf^T P for P (n, m)."""
        at_fixed = P[self._fixed].toarray()
        return np.asarray(at_fixed.T @ self._term @ at_fixed)
