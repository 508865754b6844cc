"""Preconditioners of the dual problem: none, lumped, Dirichlet, scaled by stiffness.

M^-1 = W^-1 B D^-1 S D^-1 B^T W^-1 on the active rows, with W = B D^-1 B^T and D the mean diagonal stiffness of
each node.  W is block-diagonal by node.  S is the boundary block of K (lumped), or its Schur complement (Dirichlet).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from scipy.sparse import block_diag, csr_matrix, diags

from feti_homog.feti.blocks import NodeBlocks
from feti_homog.feti.constraints import Constraints
from feti_homog.feti.local import LocalSolver

Int = NDArray[np.int64]
Float = NDArray[np.float64]


class Preconditioner(Protocol):
    """z = M^-1 r on the owned rows."""

    def activate(self, active: Float) -> None:
        """Restrict to the rows where `active` is 1."""

    def apply(self, r: Float) -> Float:
        """M^-1 r; r and the result are 0 on inactive rows."""


class BoundaryStiffness(Protocol):
    """y = S x on the boundary dofs of this rank's subdomains, one after the other."""

    def apply(self, x: Float) -> Float:
        """S x."""


class Identity:
    """z = r."""

    def activate(self, active: Float) -> None:
        """Nothing depends on the rows."""

    def apply(self, r: Float) -> Float:
        """r."""
        return r.copy()


class Lumped:
    """y = K_bb x on the boundary dofs of this rank's subdomains."""

    def __init__(self, Kbb: csr_matrix) -> None:
        self.Kbb = Kbb

    def apply(self, x: Float) -> Float:
        """K_bb x."""
        return self.Kbb @ x


class Dirichlet:
    """y = S x, S = K_bb - K_bi K_ii^-1 K_ib: the stiffness seen from the boundary."""

    def __init__(self, Kbb: csr_matrix, Kib: csr_matrix, interiors: Sequence[csr_matrix]) -> None:
        self.Kbb, self.Kib, self.Kbi = Kbb, Kib, Kib.T.tocsr()
        self.interior = LocalSolver(interiors, "feti_interior_")

    def apply(self, x: Float) -> Float:
        """S x."""
        self.interior.b[:] = self.Kib @ x
        return self.Kbb @ x - self.Kbi @ self.interior.solve()


def boundary_stiffness(
    stiffness: Sequence[csr_matrix], boundary: Sequence[Int], dirichlet: bool
) -> Lumped | Dirichlet:
    """S of all subdomains of this rank; `boundary` holds the boundary dofs of each."""
    nothing = [csr_matrix((0, 0))]
    Kbb = block_diag([K[b][:, b] for K, b in zip(stiffness, boundary, strict=True)] or nothing, format="csr")
    if not dirichlet:
        return Lumped(Kbb)
    inner = [np.setdiff1d(np.arange(K.shape[0]), b) for K, b in zip(stiffness, boundary, strict=True)]
    rows = [K[i] for K, i in zip(stiffness, inner, strict=True)]
    Kib = block_diag([r[:, b] for r, b in zip(rows, boundary, strict=True)] or nothing, format="csr")
    return Dirichlet(Kbb, Kib, [r[:, i].tocsr() for r, i in zip(rows, inner, strict=True)])


class Scaled:
    """M^-1 with the scaling of this module around a boundary stiffness."""

    def __init__(
        self,
        comm: MPI.Intracomm,
        constraints: Constraints,
        K: Sequence[csr_matrix],
        S: BoundaryStiffness,
        boundary: Sequence[Int],
    ) -> None:
        self.constraints, self.S = constraints, S
        diagonal = np.concatenate([k.diagonal() for k in K] or [np.zeros(0)]).reshape(-1, 2).mean(axis=1)
        offsets = np.cumsum([0, *(k.shape[0] for k in K)])
        dofs = np.concatenate([o + b for o, b in zip(offsets, boundary, strict=False)] or [np.zeros(0, np.int64)])
        flexibility = diags(1.0 / np.repeat(diagonal, 2)[dofs])
        Bb = constraints.B[:, dofs]
        self.BD = (Bb @ flexibility).tocsr()
        self.DBT = self.BD.T.tocsr()
        self.W = NodeBlocks(comm, constraints, self.BD @ Bb.T)
        self.activate(np.ones(self.W.rows))

    def activate(self, active: Float) -> None:
        """Invert the active part of W."""
        self.W_inverse = self.W.inverse(active)

    def apply(self, r: Float) -> Float:
        """W^-1 B D^-1 S D^-1 B^T W^-1 r."""
        x = self.DBT @ self.constraints.gather(self.W_inverse @ r)
        return self.W_inverse @ self.constraints.sum(self.BD @ self.S.apply(x))
