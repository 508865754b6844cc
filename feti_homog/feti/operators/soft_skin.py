"""A fibre that its matrix holds by springs, as the matrix sees it: a fibre with a soft skin.

At the skin the flexibility is S+ + C and the stiffness

    S~ = S - S T (I + T^T S T)^-1 T^T S,  T T^T = C,

which is exact however stiff or soft the springs are.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.sparse import csr_matrix, diags

from feti_homog.feti.operators.explicit import ExplicitInterfaceOperator
from feti_homog.typing import Float


class SoftSkinOperator(ExplicitInterfaceOperator):
    """The boundary operators of a body, with the stiffness of its skin; the flexibility is that of the body alone."""

    def __init__(self, body: ExplicitInterfaceOperator, T: csr_matrix) -> None:
        """`T` (n, r) is the root of the springs' compliance on the boundary dofs."""
        self._body, self.n = body, body.n
        S = body.S
        ST = T.T @ S  # (r, n), S being symmetric
        middle = np.eye(T.shape[1]) + np.asarray(T.T @ ST.T)
        self._S = np.asfortranarray(S - ST.T @ cho_solve(cho_factor(middle), ST))

    def apply_schur(self, x: Float, out: Float | None = None) -> Float:
        """S~ x for x (n,) or (n, k), into `out` if it is given."""
        product = self._S @ x
        if out is None:
            return product
        out[:] = product
        return out

    def apply_flexibility(self, x: Float, out: Float | None = None) -> Float:
        """S+ x of the body: the springs' part of the dual operator is a diagonal."""
        return self._body.apply_flexibility(x, out)

    @property
    def S(self) -> Float:
        """(n, n) S~."""
        return self._S

    def regularisation(self, P: csr_matrix) -> Float:
        """(m, m) P^T rho Rf Rf^T P for P (n, m): what makes S~ definite, whose kernel is that of S."""
        return self._body.regularisation(P)


def compliance_root(B: csr_matrix, compliance: Float) -> csr_matrix:
    """(n, r) T of the springs of one body, for its constraints B (rows, n) and the compliance C (rows,) of the rows.

    Where the body is cut, each of its k copies of a node has the entry 1 / k in B and a spring of the compliance k C,
    so that all of them together have C on the row.
    """
    rows = np.flatnonzero((compliance > 0) & (B.getnnz(axis=1) > 0))
    own = B[rows]
    size = np.sqrt(np.asarray(own.multiply(own).sum(axis=1)).ravel())  # 1 / k
    return (diags(np.sqrt(compliance[rows] / size**3)) @ own).T.tocsr()
