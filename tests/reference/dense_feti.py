"""The dual problem with dense matrices: Schur complements, preconditioners by NumPy alone, on every rank.

It takes K and B of each subdomain from the program, nothing else.
"""

import numpy as np
from scipy.linalg import block_diag

KERNEL = 1e-9


def boundary_of(B):
    """Dofs that the constraints B (rows, n) act on, both directions of each node."""
    nodes = np.unique(np.flatnonzero(abs(B).sum(axis=0)) // 2)
    return (2 * nodes[:, None] + np.arange(2)).ravel()


def schur(K, boundary):
    """K_bb - K_bi K_ii^-1 K_ib."""
    inside = np.setdiff1d(np.arange(len(K)), boundary)
    Kib = K[np.ix_(inside, boundary)]
    return K[np.ix_(boundary, boundary)] - Kib.T @ np.linalg.solve(K[np.ix_(inside, inside)], Kib)


def kernel(S):
    """Orthonormal null space of a positive semidefinite matrix."""
    values, vectors = np.linalg.eigh(S)
    return vectors[:, values < KERNEL * values[-1]]


def gathered(cell, own):
    """Return the rows that the ranks own, one rank after the other, on every rank. Collective."""
    return np.concatenate(cell.comm.allgather(own))


def matrix(cell, function):
    """(total, total) of a linear function of the owned rows (rows, k).  Collective."""
    first, last = cell.solver.jump_operator.owned
    return gathered(cell, function(np.eye(cell.solver.jump_operator.global_rows)[first:last]))


class DenseDual:
    """The subdomains of all ranks in the order of their numbers, on their boundaries.

    Attributes:
        S, B, D: of each subdomain: Schur complement (n, n), constraints (total, n), mean stiffness of nodes (n,).
        G: (total, kernels) B R, with kernels R of S.
        F: (total, total) sum B pinv(S) B^T; differs from the program's by G Y^T + Y G^T.
    """

    def __init__(self, cell):
        """Gather the dense problem of a cell.  Collective."""
        jump_operator = cell.solver.jump_operator
        own = []
        for s, first in zip(cell.subdomains, cell.offsets, strict=False):
            K, B = s.assemble_stiffness().toarray(), np.zeros((jump_operator.global_rows, len(s.Q)))
            B[jump_operator.rows] = jump_operator.B[:, first : first + len(s.Q)].toarray()
            at = boundary_of(B)
            diagonal = np.diag(K)[at].reshape(-1, 2)
            own.append((s.submesh.index, schur(K, at), B[:, at], np.repeat(diagonal.mean(axis=1), 2)))
        parts = sorted((part for parts in cell.comm.allgather(own) for part in parts), key=lambda part: part[0])
        self.S, self.B, self.D = ([part[i] for part in parts] for i in (1, 2, 3))
        self.total = jump_operator.global_rows
        self.kernels = [kernel(S) for S in self.S]
        self.G = np.hstack([B @ R for B, R in zip(self.B, self.kernels, strict=True)])
        inverse = [np.linalg.pinv(S, rcond=KERNEL, hermitian=True) for S in self.S]
        self.F = sum(B @ X @ B.T for B, X in zip(self.B, inverse, strict=True))

    def preconditioner(self, active):
        """(total, total) M^-1 = B_D S B_D^T of the rows where `active` is true."""
        return sum(A @ S @ A.T for A, S in zip(self.scaled(active), self.S, strict=True))

    def scaled(self, active):
        """Return of each subdomain (total, n) B_D = W^-1 B D^-1, W = B D^-1 B^T, of the rows where `active` is true."""
        W = sum(B / d @ B.T for B, d in zip(self.B, self.D, strict=True))
        inverse = np.zeros_like(W)
        inverse[np.ix_(active, active)] = np.linalg.inv(W[np.ix_(active, active)])
        return [inverse @ (B / d) for B, d in zip(self.B, self.D, strict=True)]

    def balanced(self, active, V):
        """(total, total) B_D S_0 B_D^T with S_0 = S - S Z (Z^T S Z)^+ Z^T S and Z = (I - B_D^T B) V.

        V (n, m) is of each subdomain.
        """
        S, modes = block_diag(*self.S), block_diag(*V)
        BD = np.hstack(self.scaled(active))
        Z = modes - BD.T @ (np.hstack(self.B) @ modes)
        SZ = S @ Z
        energy = Z.T @ SZ
        scale = 1 / np.sqrt(np.maximum(np.diag(energy), 1e-12 * np.diag(energy).max()))
        inverse = np.linalg.pinv(scale[:, None] * energy * scale, rcond=1e-10, hermitian=True)
        SZ *= scale
        return BD @ (S - SZ @ inverse @ SZ.T) @ BD.T


def projector(G):
    """I - G (G^T G)^-1 G^T."""
    return np.eye(len(G)) - G @ np.linalg.pinv(G)


def extreme_eigenvalues(F, H):
    """Least and largest eigenvalues of H F that are not 0, for a positive semidefinite H."""
    values, vectors = np.linalg.eigh(H)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    values = np.linalg.eigvalsh(root.T @ F @ root)
    values = values[values > 1e-7 * values[-1]]
    return values[0], values[-1]
