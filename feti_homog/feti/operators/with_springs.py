"""The protocol of boundary operators, and the operators of a body with springs on its boundary.

At the far ends of the springs the flexibility is S+ + C, with C = T T^T, and the stiffness is

    S~ = G - G R (R^T G R)^-1 R^T G,
    G = A - A T (I + T^T A T)^-1 T^T A,  A = S + s R R^T,

for the orthonormal kernel R, and a stiffness s of the size of S.  However soft the springs are, no digits cancel: A has
no kernel, R is the kernel of S~ up to rounding, and along the springs

    T^T G = (I + T^T A T)^-1 T^T A

replaces the difference.
"""

from typing import Protocol, TypeGuard

import numpy as np
from scipy.linalg import cho_solve, cholesky, solve_triangular
from scipy.sparse import csr_matrix, diags

from feti_homog.typing import Bool, Float, Int


class BoundaryOperator(Protocol):
    """S and a generalized inverse S+ of one subdomain on its n boundary dofs.

    Attributes:
        is_dense: whether it is a `DenseOperator`.
    """

    is_dense: bool

    def apply_schur(self, x: Float, out: Float | None = None) -> Float:
        """S x for x (n,) or (n, k), into `out` if it is given."""

    def apply_flexibility(self, x: Float, out: Float | None = None) -> Float:
        """S+ x for x (n,) or (n, k), into `out` if it is given."""


class DenseOperator(BoundaryOperator, Protocol):
    """A boundary operator with its dense matrix."""

    @property
    def S(self) -> Float:
        """(n, n) S."""

    def regularisation(self, P: csr_matrix) -> Float:
        """Compute P^T A P (m, m) for P (n, m), with a matrix A that makes S + A definite."""


def is_dense(operator: BoundaryOperator) -> TypeGuard[DenseOperator]:
    """Return whether the operator is a `DenseOperator`."""
    return operator.is_dense


class _Softening:
    """The change from products with S to products with S~.

    Attributes:
        kernel: (n, k) orthonormal kernel of S.
        stiffness: s, the mean of S along the springs.
    """

    def __init__(self, T: csr_matrix, ST: Float, kernel: Float) -> None:
        """`T` (n, r) has orthogonal columns, S T is `ST`, and `kernel` (n, k) spans the kernel of S."""
        self.kernel, squares = np.linalg.qr(kernel)[0], np.asarray(T.power(2).sum(axis=0)).ravel()
        # T divided by its squared column norms: T^T times these directions is I.
        self._directions = (T @ diags(1.0 / squares)).tocsr()
        self.stiffness = float(np.mean(np.asarray(T.multiply(ST).sum(axis=0)).ravel() / squares))
        self._T, self._AT = T, ST + self.stiffness * self.kernel @ (T.T @ self.kernel).T
        self._factor = cholesky(np.eye(T.shape[1]) + np.asarray(T.T @ self._AT), lower=True), True
        GR = self._relaxed(self.stiffness * self.kernel)
        root = np.linalg.cholesky((self.kernel.T @ GR + GR.T @ self.kernel) / 2)
        self._root_of_kernel = np.asarray(solve_triangular(root, GR.T, lower=True))

    def _relaxed(self, y: Float) -> Float:
        """Compute G x from y = A x."""
        along = cho_solve(self._factor, self._T.T @ y)  # T^T G x
        z = y - self._AT @ along
        return np.asarray(z + self._directions @ (along - self._T.T @ z))

    def apply(self, x: Float, Sx: Float) -> Float:
        """Compute S~ x from x (n,) or (n, k) and S x."""
        y = Sx + self.stiffness * self.kernel @ (self.kernel.T @ x)
        return np.asarray(self._relaxed(y) - self._root_of_kernel.T @ (self._root_of_kernel @ x))

    def matrix(self, S: Float) -> Float:
        """Compute the symmetric matrix S~ (n, n)."""
        A = S + self.stiffness * self.kernel @ self.kernel.T
        G = self._relaxed(A)
        # Replace the differences in columns along the springs, too.
        G += (self._directions @ (self._T.T @ G - (G @ self._T).T)).T
        return np.asarray((G + G.T) / 2 - self._root_of_kernel.T @ self._root_of_kernel, order="F")


class WithSprings:
    """A body with springs on its boundary: S~ and S+ + C, dense if the body's operators are."""

    def __init__(self, body: BoundaryOperator, T: csr_matrix, kernel: Float) -> None:
        """Set up for the root `T` (n, r) of the spring compliance, and the `kernel` (n, k) of S."""
        self._body, self._T = body, T
        self.is_dense = body.is_dense
        if is_dense(body):
            S = body.S
            self.S = _Softening(T, (T.T @ S).T, kernel).matrix(S)
            self._softer = float(self.S.diagonal().mean() / S.diagonal().mean())
        else:
            self._softening = _Softening(T, body.apply_schur(T.toarray(order="F")), kernel)

    def apply_schur(self, x: Float, out: Float | None = None) -> Float:
        """S~ x for x (n,) or (n, k), into `out` if it is given."""
        y = self.S @ x if self.is_dense else self._softening.apply(x, self._body.apply_schur(x))
        if out is None:
            return y
        out[:] = y
        return out

    def apply_flexibility(self, x: Float, out: Float | None = None) -> Float:
        """Compute (S+ + C) x for x (n,) or (n, k), into `out` if any."""
        y = self._body.apply_flexibility(x, out)
        y += self._T @ (self._T.T @ x)
        return y

    def regularisation(self, P: csr_matrix) -> Float:
        """Compute P^T rho Rf Rf^T P (m, m) for P (n, m), with rho as soft as the springs.

        This term makes S~ definite, for S and S~ have the same kernel.  The operators must be dense.
        """
        assert is_dense(self._body)
        return self._softer * self._body.regularisation(P)


def compliance_root(B: csr_matrix, compliance: Float, copies: Int, of_inner: Bool) -> csr_matrix | None:
    """Compute T (n, r) of the springs on one body, None without springs.

    A spring softens one body alone: the inner of two bodies, or the outer one if the inner one is cut there.  If both
    are cut, the spring belongs to neither; see `preconditioners.SpringUpdate`.

    Args:
        B: (rows, n) constraints of the body.
        compliance: (rows,) diagonal C.
        copies: (rows, 2) number of node copies in the outer and in the inner body.
        of_inner: (n,) whether the body is the inner one of two at each degree of freedom.
    """
    inner_is_whole = copies[:, 1] == 1
    belongs = np.where(abs(B) @ of_inner > 0, inner_is_whole, ~inner_is_whole & (copies[:, 0] == 1))
    rows = np.flatnonzero((compliance > 0) & belongs & (B.getnnz(axis=1) > 0))
    return (diags(np.sqrt(compliance[rows])) @ B[rows]).T.tocsr() if len(rows) else None
