"""Compute soft modes of a subdomain by eigenproblems on its boundary or its faces.

For a subdomain s with Schur complement S_s, constraints B_s and preconditioner M^-1, boundary displacements p with

    S_s p = theta N_s p,  N_s = B_s^T M^-1 B_s,  theta < tau

are soft in s but stiff in the preconditioner.  On a large boundary, this dense eigenproblem costs too much.  But if
every node belongs to only one other body, the weights of M^-1 hardly change along the boundary: s contributes at most
S_s to M^-1, and the neighbour's contribution makes p stiff.  Then every face has a separate eigenproblem, with the
Schur complement of the face neighbourhood instead of S_s.  All eigenproblems are projected to trace spaces.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh
from scipy.sparse import csr_matrix

from feti_homog.feti.coarse.face_neighbourhoods import face_neighbourhoods, trace_space
from feti_homog.feti.decomposition.subdomain import Subdomain
from feti_homog.feti.linalg.dense_matrices import cholesky
from feti_homog.feti.operators.with_springs import BoundaryOperator, DenseOperator, is_dense
from feti_homog.feti.thresholds import Thresholds
from feti_homog.typing import Float, Float32, Int

# Relative size below which eigenvalues of a matrix in single precision are rounding.
SINGLE_PRECISION_NULL = 10 * np.finfo(np.float32).eps


@dataclass(frozen=True)
class SubdomainBlocks:
    """The boundary matrices and the constraint rows of one subdomain.

    Attributes:
        subdomain: the subdomain.
        dofs: (n,) boundary degrees of freedom.
        operator: S and S+ of the subdomain with its springs.
        B: (rows, n) constraints.
        BW: (rows, n) scaled constraints W^-1 B D^-1, see `preconditioners`.
        facewise: whether every face has a separate eigenproblem.
    """

    subdomain: Subdomain
    dofs: Int
    operator: BoundaryOperator
    B: csr_matrix
    BW: csr_matrix
    facewise: bool

    @property
    def R(self) -> Float:
        """Return the kernel (n, k) on the boundary."""
        return self.subdomain.R[self.dofs]


class SubdomainEigenproblem:
    """The eigenproblem of a subdomain on its whole boundary."""

    def __init__(
        self, block: SubdomainBlocks, operator: DenseOperator, common: Mapping[int, Int], min_trace_dofs: int
    ) -> None:
        """Build the trace space and the subdomain's part of M^-1; `common` is one item of `Neighbours.common`."""
        self.block, self.common, self._operator, subdomain = block, common, operator, block.subdomain
        nodes = np.unique(subdomain.problem.nodes(block.dofs))
        self._P = trace_space(subdomain.submesh, subdomain.mesh.lattice, subdomain.problem, nodes, min_trace_dofs)
        # Part W^-1 B D^-1 S D^-1 B^T W^-1 of M^-1 (rows, rows); single precision separates soft from stiff modes.
        BW = block.BW.astype(np.float32)
        self._share = BW @ (BW @ operator.S.astype(np.float32)).T

    def preconditioner_shares(self) -> Iterator[tuple[int, Float32]]:
        """Yield every neighbour s, and this subdomain's part (r, r) of M^-1 on r rows shared with s."""
        for s, rows in self.common.items():
            if s != self.block.subdomain.submesh.index:
                yield s, self._share[np.ix_(rows, rows)]

    def modes(self, shares: Sequence[tuple[int, Float32]], threshold: float) -> Float:
        """Compute soft modes (n, m) with theta < `threshold`; `shares` are neighbours and their parts of M^-1."""
        M = self._share.copy()
        # Add in the order of subdomains, so that rounding does not depend on the ranks.
        for s, share in sorted(shares, key=lambda part: part[0]):
            M[np.ix_(self.common[s], self.common[s])] += share
        N = jump_energy(self.block.B, self._P, self.block.R, M)
        S = congruent(self._P, self._operator.S) + self._operator.regularisation(self._P)
        modes = np.asarray(self._P @ soft_modes(S, N, threshold))
        return self._operator.apply_flexibility(jump_forces(self.block.B, modes, self.block.R, M))


class FaceEigenproblems:
    """The eigenproblems on the faces of a subdomain, with the methods of `SubdomainEigenproblem`."""

    def __init__(self, block: SubdomainBlocks, common: Mapping[int, Int], thresholds: Thresholds) -> None:
        self.block, self.common = block, common
        self._factor, self._decayed = thresholds.face_factor, thresholds.decayed
        problem = block.subdomain.problem
        self._neighbourhoods = {}
        for s, rows in common.items():
            if s != block.subdomain.submesh.index:
                dofs = problem.dofs(np.unique(problem.nodes(block.B[rows].indices)))
                self._neighbourhoods[s] = face_neighbourhoods(block.subdomain, block.dofs, dofs, thresholds)

    def preconditioner_shares(self) -> Iterator[tuple[int, Float32]]:
        """Yield every neighbour, and an upper bound (r, r) for this subdomain's part of M^-1 on r shared rows."""
        for s, neighbourhoods in self._neighbourhoods.items():
            share = np.zeros((len(self.common[s]),) * 2)
            for part in neighbourhoods:
                BW = self.block.BW[self.common[s]][:, part.at]
                share += BW @ (BW @ part.S_fixed).T
            yield s, share.astype(np.float32)

    def modes(self, shares: Sequence[tuple[int, Float32]], threshold: float) -> Float:
        """Compute the soft face modes (n, m) with theta < `Thresholds.face_factor` x `threshold`.

        `shares` has the neighbours, with their parts of M^-1 on the common rows.  S+ extends a face mode to the whole
        boundary; displacements below `Thresholds.decayed` times the largest are set to 0.
        """
        forces = [np.zeros((len(self.block.dofs), 0))]
        for s, share in shares:
            for part in self._neighbourhoods[s]:
                B = self.block.B[self.common[s]][:, part.at]
                N = jump_energy(B, part.P, part.R, share)
                S = congruent(part.P, part.operator.regularised_schur)
                soft = part.P @ soft_modes(S, N, self._factor * threshold)
                forces.append(np.zeros((len(self.block.dofs), soft.shape[1])))
                forces[-1][part.at] = jump_forces(B, soft, part.R, share)
        modes = self.block.operator.apply_flexibility(np.asfortranarray(np.hstack(forces)))
        largest = np.abs(modes).max(axis=0, initial=0.0)
        return np.where(np.abs(modes) < self._decayed * largest, 0.0, modes)


def eigenproblem(
    block: SubdomainBlocks, common: Mapping[int, Int], thresholds: Thresholds
) -> SubdomainEigenproblem | FaceEigenproblems:
    """Set up the eigenproblem of a subdomain, or of its faces if `block.facewise`; see the two classes.

    Raises MeshError if a face neighbourhood is not a valid subdomain.  A whole boundary needs dense operators.
    """
    if block.facewise:
        return FaceEigenproblems(block, common, thresholds)
    assert is_dense(block.operator)  # `solver_plan.choose` plans no soft modes without
    return SubdomainEigenproblem(block, block.operator, common, thresholds.min_trace_dofs)


def jump_forces(B: csr_matrix, p: Float, R: Float, M: Float32) -> Float:
    """Compute the forces f = N p (n, m), N = B^T M B, and project them to R^T f = 0.

    M is M^-1 of the module on the rows of B.  S+ N p, a step of inverse iteration, turns an eigenvector p (n, m) of the
    trace space into a displacement of the body itself.  `R` (n, k) is the kernel.  f is as precise as M.
    """
    NR, Np = (np.asarray(B.T @ (M @ (B @ x).astype(np.float32)).astype(float)) for x in (R, p))
    inverse = np.linalg.pinv(R.T @ NR, rcond=SINGLE_PRECISION_NULL, hermitian=True)
    return np.asfortranarray(Np - NR @ (inverse @ (R.T @ Np)))


def congruent(T: csr_matrix | Float, A: Float | Float32) -> Float:
    """Compute T^T A T (m, m) for T (n, m) and symmetric A (n, n)."""
    return np.asarray(T.T @ (T.T @ A).T)


def jump_energy(B: csr_matrix, P: csr_matrix, R: Float, M: Float32) -> Float:
    """Compute energy products [P R]^T B^T M B [P R] (m + k, m + k); P (n, m), R (n, k), M as in `jump_forces`."""
    TP, TR = (B @ P).astype(np.float32), (B @ R).astype(np.float32)
    MR = M @ TR
    return np.block([[congruent(TP, M), TP.T @ MR], [(TP.T @ MR).T, TR.T @ MR]]).astype(float)


def soft_modes(S: Float, N: Float, threshold: float) -> Float:
    """Compute the eigenvectors q (m, j) of P^T S_s P q = theta P^T N_s P q with theta < `threshold`; j may be 0.

    Args:
        S: (m, m) P^T S_s P for the trace space P (n, m), regularised on the kernel R (n, k) of S_s.
        N: (m + k, m + k) [P R]^T N_s [P R].
    """
    m = len(S)
    NR, RNR = N[:m, m:], N[m:, m:]
    # Without its kernel part, N has eigenvectors N-orthogonal to the kernel, for which the regularised matrix equals S.
    reduced = N[:m, :m] - NR @ np.linalg.pinv(RNR, rcond=SINGLE_PRECISION_NULL, hermitian=True) @ NR.T
    # A Cholesky factorization detects soft modes at a tenth of the cost of an eigenproblem.
    try:
        cholesky(S - threshold * reduced)
    except np.linalg.LinAlgError:
        return np.asarray(eigh(reduced, S, subset_by_value=(1.0 / threshold, np.inf), overwrite_a=True)[1])
    return np.zeros((m, 0))
