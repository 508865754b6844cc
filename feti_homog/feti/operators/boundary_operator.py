"""Boundary operators of a subdomain, as preconditioners and coarse spaces use them: a protocol."""

from __future__ import annotations

from typing import Protocol, TypeGuard

from scipy.sparse import csr_matrix

from feti_homog.typing import Float


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
    """A boundary operator that has its matrix."""

    @property
    def S(self) -> Float:
        """(n, n) S."""

    def regularisation(self, P: csr_matrix) -> Float:
        """(m, m) P^T A P for P (n, m), with an A that makes S + A definite."""


def is_dense(operator: BoundaryOperator) -> TypeGuard[DenseOperator]:
    """Return whether the operator is a `DenseOperator`."""
    return operator.is_dense
