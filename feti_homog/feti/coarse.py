"""The natural coarse problem: G = B R, the projector P = I - G (G^T G)^-1 G^T and the rigid-body amplitudes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from scipy.sparse import block_diag, csr_matrix, diags

from feti_homog.cell.torus import components
from feti_homog.feti.assembled import assembled
from feti_homog.feti.constraints import Constraints
from feti_homog.feti.local import LocalSolver
from feti_homog.feti.subdomain import Subdomain

Int = NDArray[np.int64]
Float = NDArray[np.float64]

FREE = 1e-10


class CoarseProblem:
    """Solvability of all subdomains, Eq. (37), on the active multipliers: G^T lam = 0.

    The load of a macroscopic strain does no work on rigid-body motions, so e = R^T f vanishes.  G has a row a
    multiplier and a column a kernel mode; every rank holds its own rows and a factor of G^T G.
    """

    def __init__(self, comm: MPI.Intracomm, constraints: Constraints, subdomains: Sequence[Subdomain]) -> None:
        kernels = [s.R for s in subdomains]
        modes = sum(R.shape[1] for R in kernels)
        first = comm.exscan(modes) or 0
        self.comm = comm
        self.own = slice(first, first + modes)
        self.dimension: int = comm.allreduce(modes)
        self.R = csr_matrix(block_diag(kernels)) if kernels else csr_matrix((0, 0))
        body = np.repeat([s.piece.body for s in subdomains], [R.shape[1] for R in kernels])
        self.body = np.concatenate(comm.allgather(body)).astype(np.int64)
        pinned = [s.piece.body for s in subdomains if s.piece.pinned >= 0]
        self.held = comm.allreduce(max(pinned, default=-1), MPI.MAX)
        owned = constraints.owned[1] - constraints.owned[0]
        columns = np.arange(first, first + modes)
        indptr, indices, values = assembled(
            comm, constraints.B @ self.R, constraints.rows, columns, (owned, modes)
        ).getValuesCSR()
        self.G = csr_matrix((values, indices, indptr), shape=(owned, self.dimension))
        self.factorizations = 0
        squares = np.asarray(self.G.power(2).sum(axis=0)).ravel()
        self.scale = float(comm.allreduce(squares).max(initial=0.0))
        self.activate(np.ones(owned))

    def activate(self, active: Float) -> None:
        """Factorize for the owned rows of which `active` is 1; the others, 0, carry no multiplier.

        Motions that no active row resists (of a fibre that has come loose) are found and dropped.
        """
        self.Ga = (diags(active) @ self.G).tocsr()
        self.GaT = self.Ga.T.tocsr()
        gram = self._gram()
        self.free = _null_vectors(gram, self.body, self.held, FREE * self.scale)
        if self.dimension:
            held = gram + self.scale * csr_matrix(self.free @ self.free.T)
            self._solver = LocalSolver([held.tocsr()], "feti_coarse_")
            self.factorizations += 1

    def _gram(self) -> csr_matrix:
        """G^T G on every rank."""
        own = (self.GaT @ self.Ga).tocoo()
        parts = self.comm.allgather((own.data, own.row, own.col))
        data, rows, columns = (np.concatenate(part) for part in zip(*parts, strict=True))
        return csr_matrix((data, (rows, columns)), shape=(self.dimension, self.dimension))

    def amplitudes(self, x: Float) -> Float:
        """(G^T G)^-1 G^T x on every rank, for the owned rows x."""
        self.comm.Allreduce(self.GaT @ x, self._solver.b)
        return self._solver.solve()

    def project(self, x: Float) -> None:
        """x <- P x for the owned rows x, whose inactive ones are 0: what no rigid-body motion works on."""
        if self.dimension:
            x -= self.Ga @ self.amplitudes(x)

    def motion(self, amplitudes: Float) -> Float:
        """R alpha on the local dofs."""
        return self.R @ amplitudes[self.own]


def _null_vectors(gram: csr_matrix, body: Int, held: int, tolerance: float) -> Float:
    """(dimension, z) orthonormal null space of G^T G: its eigenvectors of eigenvalues below `tolerance`.

    The pieces of the body `held` are glued to the pinned class and cannot move; the others are examined
    together where they touch, so each eigenproblem has the size of a fibre's kernel.
    """
    loose = np.flatnonzero(body != held)
    rest = gram[loose][:, loose].tocoo()
    number = np.unique(body[loose], return_inverse=True)[1]
    group = components(int(number.max(initial=-1)) + 1, number[rest.row], number[rest.col])[number]
    order = np.argsort(group, kind="stable")
    rest = rest.tocsr()
    vectors = [np.zeros((0, len(body)))]
    for some in np.split(order, np.flatnonzero(np.diff(group[order])) + 1):
        values, basis = np.linalg.eigh(rest[some][:, some].toarray())
        null = basis[:, values < tolerance]
        vectors.append(np.zeros((null.shape[1], len(body))))
        vectors[-1][:, loose[some]] = null.T
    return np.concatenate(vectors).T
