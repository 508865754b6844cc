"""The protocol of boundary operators, and the operators of a body with springs on its boundary.

The body has the stiffness S and the flexibility S+.  At the far ends of springs with compliance C = T T^T, the
flexibility is S+ + C, the stiffness

    S~ = G - G R (R^T G R)^-1 R^T G,
    G = A - A T (I + T^T A T)^-1 T^T A,  A = S + s R R^T,

for the orthonormal kernel R of S, and a number s of the size of S.  No digits cancel, however soft the springs are: A
has no kernel, R is the kernel of S~ up to rounding, and along the springs the difference in G is replaced by

    T^T G = (I + T^T A T)^-1 T^T A.
"""

from typing import Protocol, TypeGuard

import numpy as np
from scipy.linalg import cho_solve, cholesky, solve_triangular
from scipy.sparse import csr_matrix, diags

from feti_homog.typing import Bool, Float, Int


class BoundaryOperator(Protocol):
    """Products with S and with a generalized inverse S+ of one subdomain, on its n boundary dofs.

    Attributes:
        is_dense: whether the operator is a `DenseOperator`.
    """

    is_dense: bool

    def apply_schur(self, x: Float, out: Float | None = None) -> Float:
        """Compute S x for x (n,) or (n, k), into `out` if given."""

    def apply_flexibility(self, x: Float, out: Float | None = None) -> Float:
        """Compute S+ x for x (n,) or (n, k), into `out` if given."""


class DenseOperator(BoundaryOperator, Protocol):
    """A boundary operator that has S as a dense matrix."""

    @property
    def S(self) -> Float:
        """Return the Schur complement S (n, n)."""

    def regularisation(self, P: csr_matrix) -> Float:
        """Compute P^T A P (m, m) for P (n, m), with a matrix A that makes S + A definite."""


def is_dense(operator: BoundaryOperator) -> TypeGuard[DenseOperator]:
    """Return whether the operator is a `DenseOperator`."""
    return operator.is_dense


class _Softening:
    """The stiffness S~ of a body with springs, by products with S.

    Attributes:
        kernel: (n, k) orthonormal kernel R of S.
        stiffness: s, the mean stiffness of S along the springs.
    """

    def __init__(self, T: csr_matrix, ST: Float, kernel: Float) -> None:
        """Factor I + T^T A T; `T` (n, r) has orthogonal columns, `ST` is S T, and `kernel` (n, k) the kernel of S."""
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
        """Compute G x from y = A x, with the matrices A and G of this module."""
        along = cho_solve(self._factor, self._T.T @ y)  # T^T G x
        z = y - self._AT @ along
        return np.asarray(z + self._directions @ (along - self._T.T @ z))

    def apply(self, x: Float, Sx: Float) -> Float:
        """Compute S~ x from x (n,) or (n, k) and S x."""
        y = Sx + self.stiffness * self.kernel @ (self.kernel.T @ x)
        return np.asarray(self._relaxed(y) - self._root_of_kernel.T @ (self._root_of_kernel @ x))

    def matrix(self, S: Float) -> Float:
        """Compute the symmetric matrix S~ (n, n) from S (n, n)."""
        A = S + self.stiffness * self.kernel @ self.kernel.T
        G = self._relaxed(A)
        # By symmetry, the differences in columns along the springs are replaced, too.
        G += (self._directions @ (self._T.T @ G - (G @ self._T).T)).T
        return np.asarray((G + G.T) / 2 - self._root_of_kernel.T @ self._root_of_kernel, order="F")


class WithSprings:
    """The boundary operator of a body with springs: S~ in place of S, S+ + C in place of S+.

    Attributes:
        is_dense: whether the operator of the body is a `DenseOperator`; then this operator is one, too.
        S: (n, n) dense matrix S~, in Fortran order; only if `is_dense`.
    """

    def __init__(self, body: BoundaryOperator, T: csr_matrix, kernel: Float) -> None:
        """Prepare S~, dense if `body` is; `T` (n, r) is the root of C = T T^T, and `kernel` (n, k) the kernel of S."""
        self._body, self._T = body, T
        self.is_dense = body.is_dense
        if is_dense(body):
            S = body.S
            self.S = _Softening(T, (T.T @ S).T, kernel).matrix(S)
            self._softer = float(self.S.diagonal().mean() / S.diagonal().mean())
        else:
            self._softening = _Softening(T, body.apply_schur(T.toarray(order="F")), kernel)

    def apply_schur(self, x: Float, out: Float | None = None) -> Float:
        """Compute S~ x for x (n,) or (n, k), into `out` if given."""
        y = self.S @ x if self.is_dense else self._softening.apply(x, self._body.apply_schur(x))
        if out is None:
            return y
        out[:] = y
        return out

    def apply_flexibility(self, x: Float, out: Float | None = None) -> Float:
        """Compute (S+ + C) x for x (n,) or (n, k), into `out` if given."""
        y = self._body.apply_flexibility(x, out)
        y += self._T @ (self._T.T @ x)
        return y

    def regularisation(self, P: csr_matrix) -> Float:
        """Compute P^T A P (m, m) for P (n, m); A is the body's A, scaled from the size of S to S~.

        S~ + A is definite, because S and S~ have the same kernel.  The operator must be dense.
        """
        assert is_dense(self._body)
        return self._softer * self._body.regularisation(P)


def compliance_root(B: csr_matrix, compliance: Float, copies: Int, of_inner: Bool) -> csr_matrix | None:
    """Compute the root T (n, r), C = T T^T, for the r springs that belong to one body.

    A spring belongs to the inner of its two bodies, or to the outer body if METIS cuts the inner body at this node.  If
    both are cut, the spring belongs to neither; see `preconditioners.SpringUpdate`.  Returns None without springs.

    Args:
        B: (rows, n) constraints of the body.
        compliance: (rows,) diagonal of C, length per nodal force.
        copies: (rows, 2) number of node copies in the outer and in the inner body.
        of_inner: (n,) whether the body is the inner body at a degree of freedom.
    """
    inner_is_whole = copies[:, 1] == 1
    belongs = np.where(abs(B) @ of_inner > 0, inner_is_whole, ~inner_is_whole & (copies[:, 0] == 1))
    rows = np.flatnonzero((compliance > 0) & belongs & (B.getnnz(axis=1) > 0))
    return (diags(np.sqrt(compliance[rows])) @ B[rows]).T.tocsr() if len(rows) else None
