"""The natural coarse problem: G = B R, the projector P = I - G (G^T G)^-1 G^T and the rigid-body amplitudes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from mpi4py import MPI
from scipy.sparse import block_diag, csr_matrix, diags, hstack

from feti_homog.cell.periodic_topology import components
from feti_homog.feti.decomposition.jump_operator import JumpOperator
from feti_homog.feti.linalg.collectives import allreduce_sparse
from feti_homog.feti.linalg.distributed_matrix import assemble_owned_rows
from feti_homog.feti.linalg.sparse_direct import DirectSolver
from feti_homog.feti.operators.interface_operators import InterfaceOperators
from feti_homog.typing import Float, Int

FREE = 1e-10


class NaturalCoarseSpace:
    """Solvability of all subdomains, Eq. (37), on the active multipliers: G^T lam = 0.

    The load of a macroscopic strain does no work on rigid-body motions, so e = R^T f vanishes.  G has a row a
    multiplier and a column a kernel mode; every rank holds its own rows and a factor of G^T G.
    """

    def __init__(self, comm: MPI.Intracomm, jump_operator: JumpOperator, boundary: InterfaceOperators) -> None:
        subdomains = boundary.subdomains
        kernels = [s.R[dofs] for s, dofs in zip(subdomains, boundary.dofs, strict=True)]
        modes = sum(R.shape[1] for R in kernels)
        first = comm.exscan(modes) or 0
        self.comm = comm
        self.own = slice(first, first + modes)
        self.dimension: int = comm.allreduce(modes)
        self.R = csr_matrix(block_diag(kernels)) if kernels else csr_matrix((0, 0))
        body = np.repeat([s.submesh.body for s in subdomains], [R.shape[1] for R in kernels])
        self.body = np.concatenate(comm.allgather(body)).astype(np.int64)
        pinned = [s.submesh.body for s in subdomains if s.submesh.pinned >= 0]
        self.held = comm.allreduce(max(pinned, default=-1), MPI.MAX)
        owned = jump_operator.owned[1] - jump_operator.owned[0]
        columns = np.arange(first, first + modes)
        self.G = assemble_owned_rows(comm, boundary.B @ self.R, jump_operator.rows, columns, (owned, modes))
        self.factorizations = 0
        squares = np.asarray(self.G.power(2).sum(axis=0)).ravel()
        self.scale = float(comm.allreduce(squares).max(initial=0.0))
        NaturalCoarseSpace.activate(self, np.ones(owned))

    def activate(self, active: Float) -> None:
        """Factorize for the owned rows of which `active` is 1; the others, 0, carry no multiplier.

        Motions that no active row resists (of a fibre that has come loose) are found and dropped.
        """
        self.Ga = (diags(active) @ self.G).tocsr()
        self.GaT = self.Ga.T.tocsr()
        gram = allreduce_sparse(self.comm, (self.GaT @ self.Ga).tocsr())
        self.free = _null_vectors(gram, self.body, self.held, FREE * self.scale)
        if self.dimension:
            held = gram + self.scale * csr_matrix(self.free @ self.free.T)
            self._solver = DirectSolver(held.tocsr(), "feti_natural_")
            self.factorizations += 1

    @property
    def vectors(self) -> int:
        """Dimension of the space that every residual is orthogonal to."""
        return self.dimension

    @property
    def deflates(self) -> bool:
        """Whether more than rigid-body motions is taken out of the Krylov method."""
        return False

    def free_motions(self, active: Float) -> int:
        """How many rigid motions the owned rows of which `active` is 1 would leave free; collective."""
        Ga = (diags(active) @ self.G).tocsr()
        gram = allreduce_sparse(self.comm, (Ga.T @ Ga).tocsr())
        return int(_null_vectors(gram, self.body, self.held, FREE * self.scale).shape[1])

    def amplitudes(self, x: Float) -> Float:
        """(G^T G)^-1 G^T x on every rank, for the owned rows x (rows,) or (rows, k)."""
        return self._solver.solve(self.everywhere(self.GaT @ x))

    def everywhere(self, part: Float) -> Float:
        """The sum over ranks."""
        whole = np.empty_like(part)
        self.comm.Allreduce(part, whole)
        return whole

    def project(self, x: Float) -> None:
        """x <- P x for the owned rows x, whose inactive ones are 0: what no rigid-body motion works on."""
        if self.dimension:
            x -= self.Ga @ self.amplitudes(x)

    def projected(self, x: Float) -> Float:
        """P x."""
        y = x.copy()
        self.project(y)
        return y

    def destroy(self) -> None:
        """Nothing is held that ranks would have to free together."""

    def simplify(self) -> bool:
        """Make the coarse space simpler after the Krylov method broke down; whether it could be."""
        return False

    def admissible(self, z: Float) -> Float:
        """The part of a correction z that the Krylov method may use."""
        return self.projected(z)

    def residual(self, r: Float) -> Float:
        """The part of a residual r that the Krylov method has to remove."""
        return self.projected(r)

    def improved(self, lam: Float, residual: Float, apply: Callable[[Float], Float]) -> tuple[Float, Float]:
        """First multipliers and their residual (rows, k), after what the coarse space by itself does for them.

        `apply` is the dual operator on the active rows.
        """
        return lam, residual

    def motion(self, amplitudes: Float) -> Float:
        """R alpha on the boundary dofs."""
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
    sizes, rest = np.bincount(group), rest.tocsr()
    starts = np.cumsum(sizes) - sizes
    parts = [csr_matrix((len(body), 0))]
    for size in np.unique(sizes):
        members = order[starts[sizes == size][:, None] + np.arange(size)]
        values, vectors = np.linalg.eigh(_blocks(rest, members))
        which, mode = np.nonzero(values < tolerance)
        at = loose[members[which]].ravel(), np.repeat(np.arange(len(which)), size)
        null = vectors[which, :, mode].ravel()
        parts.append(csr_matrix((null, at), shape=(len(body), len(which))))
    return np.asarray(hstack(parts).toarray())


def _blocks(matrix: csr_matrix, members: Int) -> Float:
    """(b, m, m) dense blocks of the rows and columns `members` (b, m)."""
    rows, columns = np.broadcast_arrays(members[:, :, None], members[:, None, :])
    return np.asarray(matrix[rows.ravel(), columns.ravel()]).reshape(rows.shape)
