"""The boundary operators of one subdomain: Schur complement S and flexibility S+, dense or by sparse factors.

Dense S and S+ are symmetric and share one square array, so that a product reads n^2 / 2 numbers.  One partial
factorization gives S.  As the dual problem lives on the boundary, the factor is kept only for displacements inside.
Sparse factors replace dense matrices that would be too large.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg.blas import dsymm, dsymv
from scipy.sparse import csr_matrix

from feti_homog.feti import thresholds
from feti_homog.feti.decomposition.subdomain import Subdomain
from feti_homog.feti.linalg.sparse_direct import DirectSolver
from feti_homog.typing import Float, Int


class ExplicitInterfaceOperator:
    """The dense matrices S and S+ (n, n), Schur complement and flexibility, on n boundary dofs of a subdomain.

    With fixing nodes on the boundary, the inverse of S + rho Rf Rf^T (`Subdomain.fixing`) is the boundary part of K+.

    Attributes:
        condensed: unit loads, condensed to the boundary.
        factor: factor of the whole subdomain for displacements inside; None if not kept.
    """

    is_dense = True

    def __init__(self, subdomain: Subdomain, K: csr_matrix, dofs: Int, keep_factor: bool = False) -> None:
        """Condense K (all dofs, all dofs) to the boundary `dofs` (n,), in ascending order.

        Options have the prefix `feti_schur_`.  `keep_factor` keeps CHOLMOD's factor if loads act inside.

        Raises:
            LinAlgError, MemoryError, FetiHomogError: as in `schur_complement`; LinAlgError if S is indefinite, too.
        """
        from feti_homog.feti.linalg import dense_matrices  # sparse operators do not need it

        fixed, self._term = subdomain.fixing(K, np.unique(subdomain.problem.nodes(dofs)))
        self._fixed = np.searchsorted(dofs, fixed)
        self.n, self._subdomain = len(dofs), subdomain
        self.factor, q, C, order = None, subdomain.Q[dofs], subdomain.volume_stiffness, subdomain.elimination_order()
        if subdomain.loads_inside:
            condensed = dense_matrices.condensed_with_loads(K, dofs, subdomain.Q, order, keep_factor)
            both, q, C, self.factor = condensed.S, condensed.q, C + condensed.C, condensed.factor
        else:
            both = dense_matrices.schur_complement(K, dofs, order)
        self.condensed = CondensedLoads(q, C, C)
        self._schur_diagonal = both.diagonal().copy()
        # S stays below the diagonal; the inverse of the regularised S goes above the diagonal.
        both[np.ix_(self._fixed, self._fixed)] += np.triu(self._term)
        try:
            dense_matrices.invert_upper(both)
        except np.linalg.LinAlgError as error:
            raise np.linalg.LinAlgError(f"the regularised Schur complement of a subdomain: {error}") from error
        self._flexibility_diagonal = both.diagonal().copy()
        # Diagonal entries are lower bounds of matrix norms.
        conditioning = self._schur_diagonal.max(initial=0.0) * self._flexibility_diagonal.max(initial=0.0)
        # A ratio that the material has in its directions is no neck: there refinement would lose digits.
        of_material = np.linalg.cond(subdomain.L) ** 2 if subdomain.material is None else np.inf
        is_thin = subdomain.is_thin or conditioning > of_material
        ratio = max(conditioning * is_thin, 1.0 / subdomain.compressible_share)
        self._refines = bool(ratio > thresholds.ILL_CONDITIONED)
        np.fill_diagonal(both, 0.0)
        self._both = both

    def apply_schur(self, x: Float, out: Float | None = None) -> Float:
        """Compute S x for x (n,) or (n, k), into `out` if given, else in Fortran order."""
        return self._product(x, out, self._schur_diagonal, lower=1)

    def apply_flexibility(self, x: Float, out: Float | None = None) -> Float:
        """Compute S+ x for x (n,) or (n, k), into `out` if given, else in Fortran order.

        For a thin or nearly incompressible body, with a stiffness ratio above ILL_CONDITIONED, the product gets one
        step of iterative refinement.
        """
        y = self._product(x, out, self._flexibility_diagonal, lower=0)
        if self._refines:
            residual = x - self.apply_schur(y)
            residual[self._fixed] -= self._term @ y[self._fixed]
            y += self._product(residual, None, self._flexibility_diagonal, lower=0)
        return y

    def _product(self, x: Float, out: Float | None, diagonal: Float, lower: int) -> Float:
        """Multiply x by the symmetric matrix of `diagonal` (n,) and the stored upper (`lower` 0) or lower (1) triangle.

        The product goes into `out` if given, and is fastest for x in Fortran order.
        """
        A = self._both
        if out is None:
            out = np.empty(x.shape, order="F")
        if x.size > thresholds.DENSE_COLUMNS_ONE_BY_ONE * self.n:
            scaled = np.multiply(diagonal[:, None], x, order="F")
            out[:] = dsymm(1.0, A, x, beta=1.0, c=scaled, overwrite_c=1, lower=lower)
        else:
            for column, result in zip(x.reshape(self.n, -1).T, out.reshape(self.n, -1).T, strict=True):
                np.multiply(diagonal, column, out=result)
                result[:] = dsymv(1.0, A, column, beta=1.0, y=result, overwrite_y=1, lower=lower)
        return out

    def extend(self, x: Float, loads: Float | None) -> Float:
        """Extend displacements x (n, k) to (all dofs, k) by `factor`, under `loads` (v, k); None without loads."""
        assert self.factor is not None
        forces, reactions = np.zeros((self._subdomain.n_dofs, *x.shape[1:])), self.apply_schur(x)
        if loads is not None:
            forces, reactions = self._subdomain.Q @ -loads, reactions + self.condensed.boundary @ loads
        forces[self.factor.rows] += reactions
        return self.factor.solution(forces, x)

    @property
    def S(self) -> Float:
        """Copy the Schur complement S (n, n)."""
        from feti_homog.feti.linalg import dense_matrices

        S = dense_matrices.full_from_lower(self._both)
        np.fill_diagonal(S, self._schur_diagonal)
        return S

    @property
    def regularised_schur(self) -> Float:
        """Compute S + rho Rf Rf^T (n, n), positive definite; see `Subdomain.fixing`."""
        S = self.S
        S[np.ix_(self._fixed, self._fixed)] += self._term
        return S

    def regularisation(self, P: csr_matrix) -> Float:
        """Compute P^T rho Rf Rf^T P (m, m) for P (n, m)."""
        at_fixed = P[self._fixed].toarray()
        return np.asarray(at_fixed.T @ self._term @ at_fixed)


@dataclass(frozen=True)
class CondensedLoads:
    """The v unit loads, condensed to the n boundary dofs b of one or several subdomains.

    With K_ii u_i = -Q_i E - K_ib u_b on the inner dofs i, the stress integral is C E + q^T u_b and the boundary forces
    are S u_b + q E, where

        q = Q_b - K_bi K_ii^-1 Q_i,  C = |Omega| L - Q_i^T K_ii^-1 Q_i.

    Q_i = 0 unless `Subdomain.loads_inside`.

    Attributes:
        boundary: (n, v) q.
        stiffness: (v, v) C, or its sum over subdomains.
        energy: (v, v) twice the energy at u_b = 0, equal to C.  A subdomain without a boundary has
            |Omega| L + 2 Q_i^T u_i + u_i^T K_ii u_i, which is C only if u_i is exact.
    """

    boundary: Float
    stiffness: Float
    energy: Float


class ImplicitInterfaceOperator:
    """The operators S and S+, Schur complement and flexibility, of a subdomain by sparse factors of K."""

    is_dense = False

    def __init__(self, subdomain: Subdomain, K: csr_matrix, dofs: Int) -> None:
        """Factor K + rho Rf Rf^T (`Subdomain.fixing`), or K_ii of held subdomains without boundary; `dofs` (n,) ascend.

        Options have the prefix `feti_sub_`, or `feti_interior_` for K_ii.  Raises like `DirectSolver`.
        """
        self.n, self.dofs, self._subdomain = len(dofs), dofs, subdomain
        if not len(dofs) and not subdomain.R.shape[1]:
            # A pinned subdomain without a boundary bears the unit loads alone: solve for their displacements now.
            s, u = subdomain, np.empty(subdomain.Q.shape)
            self.interior = Interior(K, dofs, s.elimination_order())
            self.interior.answers = self.interior.solve(-s.Q[self.interior.dofs])
            u[self.interior.dofs] = self.interior.answers
            C = s.volume_stiffness + s.Q.T @ u
            self.condensed = CondensedLoads(s.Q[dofs], C, C + s.Q.T @ u + u.T @ (K @ u))
            return
        # In a subdomain without a boundary any nodes can be fixed.
        boundary = subdomain.problem.nodes(dofs)
        nodes = np.unique(boundary) if len(dofs) else np.arange(subdomain.mesh.n_classes)
        self._solver = DirectSolver(subdomain.regularised(K, nodes), "feti_sub_")

    @cached_property
    def interior(self) -> Interior:
        """Assemble K again and factor its interior, at the first access."""
        return Interior(self._subdomain.take_stiffness(), self.dofs, self._subdomain.elimination_order())

    @cached_property
    def condensed(self) -> CondensedLoads:
        """Return the unit loads condensed to the boundary; the factored interior eliminates loads inside."""
        s, q, C = self._subdomain, self._subdomain.Q[self.dofs], self._subdomain.volume_stiffness
        if s.loads_inside:
            inside = s.Q[self.interior.dofs]
            u = self.interior.solve(-inside)
            q, C = q + self.interior.coupling @ u, C + inside.T @ u
        return CondensedLoads(q, C, C)

    def apply_schur(self, x: Float, out: Float | None = None) -> Float:
        """Compute S x = K_bb x - K_bi K_ii^-1 K_ib x for x (n,) or (n, k), into `out` if given."""
        return _by_columns(self.interior.reactions, x, out)

    def apply_flexibility(self, x: Float, out: Float | None = None) -> Float:
        """Compute S+ x, the boundary part of K+, for x (n,) or (n, k), into `out` if given."""

        def solve(x: Float) -> Float:
            load = np.zeros((self._subdomain.n_dofs, *x.shape[1:]), order="F")
            load[self.dofs] = x
            return self._solver.solve(load)[self.dofs]

        return _by_columns(solve, x, out)


class Interior:
    """The inner dofs i of one subdomain, which no constraint reaches, with a factor of K_ii.

    Attributes:
        dofs: (inner dofs,) numbers in the subdomain, in the given elimination order, else ascending.
        answers: (inner dofs, v) displacements under the unit loads; None unless stored.
    """

    answers: Float | None = None

    def __init__(self, K: csr_matrix, dofs: Int, order: Int | None = None) -> None:
        """Factor K_ii; `K` (all dofs, all dofs) is split at boundary `dofs` (n,).  Raises like `DirectSolver`.

        Options have the prefix `feti_interior_`.  `order` (all dofs,) is an elimination order, None for the solver's.
        """
        inside = np.ones(K.shape[0], bool)
        inside[dofs] = False
        self.dofs = np.flatnonzero(inside) if order is None else order[inside[order]]
        rows = K[self.dofs]
        self._Kib, self._Kbb = rows[:, dofs], K[dofs][:, dofs]
        if not len(self.dofs):
            return
        if len(dofs):
            A = rows[:, self.dofs].tocsr()
        else:  # all columns, in another order
            place = np.empty(K.shape[0], rows.indices.dtype)
            place[self.dofs] = np.arange(len(place))
            A = csr_matrix((rows.data, place[rows.indices], rows.indptr), shape=K.shape)
        self._solver = DirectSolver(A, "feti_interior_", order is not None)

    @cached_property
    def coupling(self) -> csr_matrix:
        """Return K_bi (n, inner dofs)."""
        return self._Kib.T.tocsr()

    def extend(self, x: Float, load: Float | None = None) -> Float:
        """Compute the inner displacements u_i = -K_ii^-1 (K_ib x + q) for boundary displacements x (n,) or (n, k).

        `load` is q, (inner dofs,) or (inner dofs, k); 0 if None.
        """
        forces = self._Kib @ x
        return self.solve(-forces if load is None else -forces - load)

    def solve(self, forces: Float) -> Float:
        """Compute inner displacements K_ii^-1 f for `forces` f (inner dofs,) or (inner dofs, k)."""
        return self._solver.solve(forces) if len(self.dofs) else np.zeros(forces.shape)

    def reactions(self, x: Float) -> Float:
        """Compute the boundary forces S x for x (n,) or (n, k)."""
        return np.asarray(self._Kbb @ x + self.coupling @ self.extend(x))


def _by_columns(apply: Callable[[Float], Float], x: Float, out: Float | None) -> Float:
    """Apply a function to x (n,), or to batches of COLUMNS_AT_ONCE columns of x (n, k), into `out` if given."""
    if out is None:
        out = np.empty_like(x)
    if not len(x):
        return out
    if x.size <= thresholds.COLUMNS_AT_ONCE * len(x):
        out[:] = apply(x)
        return out
    for first in range(0, x.shape[1], thresholds.COLUMNS_AT_ONCE):
        batch = slice(first, first + thresholds.COLUMNS_AT_ONCE)
        out[:, batch] = apply(x[:, batch])
    return out
