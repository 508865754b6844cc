"""A fibre that its matrix holds by springs, as the matrix sees it: a fibre with a soft skin.

At the skin the flexibility is S+ + C and the stiffness

    S~ = S - S T (I + T^T S T)^-1 T^T S,  T T^T = C,

which is exact however stiff or soft the springs are.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import LinAlgError, cholesky, solve_triangular
from scipy.sparse import csr_matrix, diags

from feti_homog.errors import ConvergenceError
from feti_homog.feti.operators.explicit import ExplicitInterfaceOperator
from feti_homog.feti.operators.implicit import ImplicitInterfaceOperator
from feti_homog.typing import Bool, Float, Int


class DenseSoftSkin(ExplicitInterfaceOperator):
    """The boundary operators of a body with its skin."""

    def __init__(self, body: ExplicitInterfaceOperator, T: csr_matrix) -> None:
        """`T` (n, r) is the root of the springs' compliance on the boundary dofs."""
        self._body, self._T, self.n = body, T, body.n
        S = body.S
        half = _half(T, T.T @ S)
        self._S = np.asfortranarray(S - half.T @ half)

    def apply_schur(self, x: Float, out: Float | None = None) -> Float:
        """S~ x for x (n,) or (n, k), into `out` if it is given."""
        product = self._S @ x
        if out is None:
            return product
        out[:] = product
        return out

    def apply_flexibility(self, x: Float, out: Float | None = None) -> Float:
        """(S+ + C) x for x (n,) or (n, k), into `out` if it is given."""
        y = self._body.apply_flexibility(x, out)
        y += self._T @ (self._T.T @ x)
        return y

    @property
    def S(self) -> Float:
        """(n, n) S~."""
        return self._S

    def regularisation(self, P: csr_matrix) -> Float:
        """(m, m) P^T rho Rf Rf^T P for P (n, m): what makes S~ definite, whose kernel is that of S."""
        return self._body.regularisation(P)


class SparseSoftSkin(ImplicitInterfaceOperator):
    """The same of a body whose operators are sparse factors, for few springs."""

    def __init__(self, body: ImplicitInterfaceOperator, T: csr_matrix) -> None:
        self._body, self._T = body, T
        self._half = _half(T, body.apply_schur(T.toarray(order="F")).T)

    def apply_schur(self, x: Float, out: Float | None = None) -> Float:
        """S~ x for x (n,) or (n, k), into `out` if it is given."""
        y = self._body.apply_schur(x, out)
        y -= self._half.T @ (self._half @ x)
        return y

    def apply_flexibility(self, x: Float, out: Float | None = None) -> Float:
        """(S+ + C) x for x (n,) or (n, k), into `out` if it is given."""
        y = self._body.apply_flexibility(x, out)
        y += self._T @ (self._T.T @ x)
        return y


def soft_skin(
    body: ExplicitInterfaceOperator | ImplicitInterfaceOperator, T: csr_matrix
) -> ExplicitInterfaceOperator | ImplicitInterfaceOperator:
    """The operators of a body whose springs have the compliance T T^T on its boundary dofs."""
    return DenseSoftSkin(body, T) if isinstance(body, ExplicitInterfaceOperator) else SparseSoftSkin(body, T)


def _half(T: csr_matrix, TS: Float) -> Float:
    """(r, n) H with H^T H = S T (I + T^T S T)^-1 T^T S, for T^T S (r, n).

    Raises:
        ConvergenceError: the springs are so soft beside the body that rounding of S hides them.
    """
    middle = np.eye(T.shape[1]) + np.asarray(T.T @ TS.T)
    try:
        factor = cholesky(middle, lower=True)
    except LinAlgError as error:
        ratio = np.abs(middle.diagonal()).max()
        raise ConvergenceError(
            f"[interface] springs {ratio:.1e} times as soft as the body that they hold: rounding hides them"
        ) from error
    return np.asarray(solve_triangular(factor, TS, lower=True))


def compliance_root(B: csr_matrix, compliance: Float, copies: Int, of_fibre: Bool) -> csr_matrix:
    """(n, r) T of the springs on one body, for its constraints B (rows, n) and the compliance C (rows,) of the rows.

    A node's spring belongs to the fibre, but where the fibre is cut, to the matrix: so it softens one body alone.
    Where both are cut it belongs to neither; see `preconditioners.spring_update`.

    Args:
        copies: (rows, 2) how many copies matrix and fibre have there.
        of_fibre: (n,) on which of the dofs the body is the fibre: a coating is the matrix of what it coats.
    """
    whole = copies[:, 1] == 1
    own = np.where(abs(B) @ of_fibre > 0, whole, ~whole & (copies[:, 0] == 1))
    rows = np.flatnonzero((compliance > 0) & own & (B.getnnz(axis=1) > 0))
    return (diags(np.sqrt(compliance[rows])) @ B[rows]).T.tocsr()
