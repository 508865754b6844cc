"""The inverse of a block of a symmetric matrix, for rows that come, go or stiffen: O(k^2) a row."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI
from scipy.linalg.lapack import dpstrf

from feti_homog.feti.thresholds import INVERSE_ERROR, SINGULAR_PIVOT
from feti_homog.typing import Bool, Float, Int


class BorderedInverse:
    """N = M[C, C]^-1 for members C of a quasi-definite matrix M, the same on all ranks.

    Rows may differ in unit and by many orders: each has a size of its own, and what is rounding is so beside that.

    Attributes:
        members: (k,) C, in the order of the rows of N.
        N: (k, k).
        M: (k, k) M[C, C].
        added: (k,) the part of the diagonal of M that changes.
        dependent: those that `exchange` left out, for they depend on others.
    """

    def __init__(self, comm: MPI.Intracomm) -> None:
        """No members yet."""
        self._comm = comm
        self.members: Int = np.zeros(0, np.int64)
        self.dependent: Int = self.members
        self.N = self.M = np.zeros((0, 0))
        self._root = self.added = np.zeros(0)

    def exchange(self, M: Float, stiffness: Float, changed: Int, returned: Bool, added: Float) -> None:
        """Take the members that are not `changed` (p,) out, and the others in: those `returned` (p,) with sign -1.

        The diagonal of the matrix `M` (n, n) gets `added` (p,) there; `stiffness` (n,) as `size` of sign 1, its inverse
        of -1.  Collective.
        """
        D = np.zeros(len(stiffness))
        D[changed] = added
        # What no longer holds at all is taken out and in again, for N may be singular with it.
        left = (D[self.members] == 0.0) & (self.added > 0.0)
        gone = np.union1d(np.setdiff1d(self.members, changed), self.members[left])
        self.remove(gone)
        at = np.flatnonzero(D[self.members] != self.added)
        if len(at):
            self.change(at, D[self.members[at]])
        taken_in = np.setdiff1d(changed[returned], self.members)
        self.append(M, 1.0 / stiffness, taken_in, -1, D)
        if len(gone) or len(taken_in):
            self.dependent = np.zeros(0, np.int64)
        left_out = np.setdiff1d(changed[~returned], np.concatenate([self.members, self.dependent]))
        self.append(M, stiffness, left_out, 1, D)
        self.dependent = np.setdiff1d(changed, self.members)

    def append(self, M: Float, size: Float, new: Int, sign: int, added: Float | None = None) -> None:
        """Border with the members `new`, on which `sign` M, Schur's complement of the others, is semi-definite.

        M is the matrix `M` (n, n), of which only blocks are read, plus the diagonal `added` (n,), if any.

        `size` (n,) is what the diagonal of `sign` M may be; less than a share SINGULAR_PIVOT of it is rounding.  Those
        that depend on others, as rank 0 finds, are left out.  With s the pivots, b = M[C, new], w = N b,

            N <- [ N + w s^-1 w^T    -w s^-1 ]
                 [ -s^-1 w^T          s^-1   ].

        Collective.
        """
        if not len(new):
            return
        added = np.zeros(len(M)) if added is None else added
        border = M[self.members[:, None], new]
        w = self.N @ border
        block = M[new[:, None], new] + np.diag(added[new])
        own = np.sqrt(np.maximum(size[new], sign * block.diagonal()))
        pivots = sign * (block - border.T @ w) / np.outer(own, own)
        factor, order, rank, _ = dpstrf(pivots, tol=SINGULAR_PIVOT, lower=1)
        # The first pivot is taken whatever it is.
        rank = min(rank, int((factor.diagonal() ** 2 > SINGULAR_PIVOT).sum()))
        # Other ranks may round another way, pivot in another order, or find no root where one is nearly singular.
        kept, root = self._comm.bcast((order[:rank] - 1, np.tril(factor[:rank, :rank])))
        half = np.linalg.inv(root) / own[kept]
        inverse, w = sign * half.T @ half, w[:, kept]
        k, rank, scaled = len(self.members), len(kept), w @ inverse
        N = np.empty((k + rank, k + rank))
        np.matmul(scaled, w.T, out=N[:k, :k])
        N[:k, :k] += self.N
        N[:k, k:], N[k:, :k], N[k:, k:] = -scaled, -scaled.T, inverse
        self.N, self.members = N, np.concatenate([self.members, new[kept]])
        self.added, self._root = added[self.members], np.concatenate([self._root, own[kept]])
        self.M = M[self.members[:, None], self.members] + np.diag(self.added)

    def change(self, at: Int, added: Float) -> None:
        """Let the diagonal of M have `added` (p,) at the places `at` (p,) among the members: with its change d there,

        N <- N - N_:p (d^-1 + N_pp)^-1 N_p:.
        """
        change = added - self.added[at]
        columns = self.N[:, at]
        self.N -= columns @ np.linalg.solve(np.diag(1.0 / change) + columns[at], columns.T)
        self.added[at] = added
        self.M[at, at] += change

    def remove(self, gone: Int) -> None:
        """Take members out: N <- N_cc - N_cg N_gg^-1 N_gc."""
        if not len(gone):
            return
        leaves = np.isin(self.members, gone)
        c, g = np.flatnonzero(~leaves), np.flatnonzero(leaves)
        coupling = self.N[c[:, None], g] * self._root[g]
        block = self.N[g[:, None], g] * np.outer(self._root[g], self._root[g])
        self.N = self.N[c[:, None], c] - coupling @ np.linalg.solve(block, coupling.T)
        self.members, self.M, self._root = self.members[c], self.M[c[:, None], c], self._root[c]
        self.added = self.added[c]

    def solve(self, b: Float) -> Float:
        """M[C, C]^-1 b for b (k,) or (k, n), with one step of iterative refinement: borders add up rounding."""
        x = self.N @ b
        return np.asarray(x + self.N @ (b - self.M @ x))

    def blocks(self, M: Float, at: Int, returned: Bool) -> Float:
        """(m, 2, 2) diagonal blocks of M - U N U^T at the pairs `at` (2m,) of rows of M, with U = M[:, C].

        On those `returned` (2m,) U has the rows of the identity, and the first M is 0.
        """
        pairs = at.reshape(-1, 2)
        U, own = M[at[:, None], self.members], M[pairs[:, :, None], pairs[:, None, :]]
        U[returned] = at[returned, None] == self.members
        both, paired = ~returned.reshape(-1, 2), U.reshape(len(pairs), 2, len(self.members))
        own = np.where(both[:, :, None] & both[:, None, :], own, 0.0)
        return np.asarray(own - np.matmul((U @ self.N).reshape(paired.shape), paired.transpose(0, 2, 1)))

    def holds(self) -> bool:
        """Check M[C, C] N x = x but for rounding, for a vector x of the rows' sizes, on rank 0.  Collective."""
        x = np.cos(np.arange(float(len(self.members)))) * self._root
        off = (self.M @ (self.N @ x) - x) / self._root
        return bool(self._comm.bcast(bool(np.abs(off).max(initial=0.0) <= INVERSE_ERROR)))
