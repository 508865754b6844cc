"""Local eigenproblems that find what slows the preconditioned dual operator down.

For a subdomain s with Schur complement S_s and constraints B_s, the displacements p of its boundary with

    S_s p = theta N_s p,  N_s = B_s^T M^-1 B_s,  theta < tau

are soft in s but stiff in the eyes of the preconditioner; with the jumps B_s p deflated, the largest eigenvalue of
P M^-1 F is about 1 / tau whatever the geometry and the materials (GenEO: Spillane & Rixen, IJNME 95, 2013).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from scipy.linalg import eigh
from scipy.sparse import csc_matrix, csr_matrix

from feti_homog.feti.assembled import summed
from feti_homog.feti.boundary import Boundary
from feti_homog.feti.condensed import Condensed
from feti_homog.feti.constraints import Constraints
from feti_homog.feti.neighbours import Neighbours
from feti_homog.feti.preconditioner import Scaled

Int = NDArray[np.int64]
Float = NDArray[np.float64]
Single = NDArray[np.float32]


@dataclass(frozen=True)
class DualBlock:
    """One subdomain on the rows of its nodes.

    Attributes:
        operator: its dense boundary operators, n dofs.
        R: (n, k) kernel on the boundary.
        B: (rows, n) constraints.
        BW: (rows, n) scaled constraints W^-1 B D^-1.
    """

    operator: Condensed
    R: Float
    B: csr_matrix
    BW: csr_matrix

    @property
    def preconditioner(self) -> Float:
        """(rows, rows) its share W^-1 B D^-1 S D^-1 B^T W^-1 of M^-1."""
        return np.asarray(self.BW @ (self.BW @ self.operator.S).T)


def dual_blocks(
    comm: MPI.Intracomm, constraints: Constraints, boundary: Boundary, scaling: Scaled, rows: Sequence[Int]
) -> list[DualBlock]:
    """The blocks of this rank's subdomains, all of which must be dense; `rows` are those of their nodes."""
    owned = constraints.owned[1] - constraints.owned[0]
    inverse = scaling.W_inverse.tocoo()
    at = np.searchsorted(constraints.rows, constraints.owned[0])
    shape = (len(constraints.rows), constraints.total)
    wide = csr_matrix((inverse.data, (inverse.row + at, inverse.col + constraints.owned[0])), shape=shape)
    W_inverse = summed(comm, wide, constraints.rows, constraints.foreign, owned)[:, constraints.rows]
    B, BW = boundary.B.tocsc(), (W_inverse @ scaling.BD).tocsc()
    blocks = []
    for i, (subdomain, operator) in enumerate(zip(boundary.subdomains, boundary.operators, strict=True)):
        if not isinstance(operator, Condensed):
            raise TypeError("coarse vectors need dense boundary operators")
        span = boundary.spans[i]
        R = subdomain.R[boundary.dofs[i]]
        blocks.append(DualBlock(operator, R, _columns(B, span, rows[i]), _columns(BW, span, rows[i])))
    return blocks


def coarse_vectors(blocks: Sequence[DualBlock], neighbours: Neighbours, threshold: float) -> list[Float]:
    """For each subdomain of this rank: (n, k + m) its kernel and its m modes below the threshold.  Collective.

    The dense matrices of the operators are released.
    """
    # Of the neighbours' shares in M^-1 the rows that both have; single precision is enough to tell soft from stiff.
    others: list[list[tuple[int, Single]]] = [[] for _ in blocks]

    def shares() -> Iterator[tuple[int, int, Single]]:
        for i, block in enumerate(blocks):
            M = block.preconditioner
            for s, common in neighbours.common[i].items():
                if s != neighbours.index[i]:
                    yield i, s, M[np.ix_(common, common)].astype(np.float32)

    neighbours.exchange(shares(), lambda i, sender, M: others[i].append((sender, M)))
    vectors = []
    for i, block in enumerate(blocks):
        M = block.preconditioner
        for sender, share in others[i]:
            at = neighbours.common[i][sender]
            M[np.ix_(at, at)] += share
        others[i].clear()
        vectors.append(np.hstack([block.R, soft_modes(block, block.B.T @ (block.B.T @ M).T, threshold)]))
        block.operator.release()
    return vectors


def soft_modes(block: DualBlock, N: Float, threshold: float) -> Float:
    """(n, m) eigenvectors p, S p = theta N p with theta < threshold, besides the kernel."""
    # Less the kernel's part, N has eigenvectors N-orthogonal to the kernel, and S may be held.
    NR = N @ block.R
    rest = N - NR @ np.linalg.solve(block.R.T @ NR, NR.T)
    above = (1.0 / threshold, np.inf)
    modes = eigh(rest, block.operator.held, subset_by_value=above, overwrite_a=True)[1]
    return np.asarray(modes)


def _columns(matrix: csc_matrix, span: slice, rows: Int) -> csr_matrix:
    """The columns `span` on the sorted `rows`, which hold all their entries."""
    indptr = matrix.indptr[span.start : span.stop + 1]
    part = slice(indptr[0], indptr[-1])
    at = np.searchsorted(rows, matrix.indices[part])
    shape = (len(rows), span.stop - span.start)
    return csc_matrix((matrix.data[part], at, indptr - indptr[0]), shape=shape).tocsr()
