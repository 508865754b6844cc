"""The natural coarse space: G = B R, the projector P = I - G (G^T G)^-1 G^T and the rigid-body amplitudes, Eq. (37)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from mpi4py import MPI
from scipy.sparse import block_diag, csr_matrix, diags, hstack

from feti_homog.cell.periodic_topology import components
from feti_homog.common.distributed_arrays import allreduce_sum
from feti_homog.feti.decomposition.jump_operator import JumpOperator
from feti_homog.feti.linalg.collectives import allreduce_sparse
from feti_homog.feti.linalg.distributed_matrix import assemble_owned_rows
from feti_homog.feti.linalg.sparse_direct import DirectSolver
from feti_homog.feti.operators.interface_operators import InterfaceOperators
from feti_homog.feti.thresholds import UNCONSTRAINED_EIGENVALUE
from feti_homog.typing import Float, Int


class NaturalCoarseSpace:
    """Solvability of all subdomains on the active multipliers: G^T lam = 0.

    The load of a macroscopic strain does no work on rigid-body motions, so e = R^T f vanishes.  G has a row for each
    multiplier and a column for each kernel mode; every rank holds its own rows and a factor of G^T G.

    Attributes:
        kernel_dimension: kernel modes of all subdomains, m.
        owned_modes: where those of this rank's subdomains are among the m.
        R: (boundary dofs, own modes) kernels on the boundaries.
        G: (owned rows, m); `G_active` is 0 in inactive rows, and `GT_active` its transpose.
        body: (m,) body that each mode moves.
        pinned_body: the body with the pinned class, -1 if there is none.
        unconstrained_modes: (m, z) orthonormal amplitudes of the motions that no active row resists.
        factorizations: of G^T G so far.
    """

    def __init__(self, comm: MPI.Intracomm, jump_operator: JumpOperator, operators: InterfaceOperators) -> None:
        """Assemble G and factor for all rows.  Options under `feti_natural_` (default: cholesky by CHOLMOD).
        Collective."""
        subdomains = operators.subdomains
        kernels = [s.R[dofs] for s, dofs in zip(subdomains, operators.dofs, strict=True)]
        modes = sum(R.shape[1] for R in kernels)
        first = comm.exscan(modes) or 0
        self.comm = comm
        self.owned_modes = slice(first, first + modes)
        self.kernel_dimension: int = comm.allreduce(modes)
        self.R = csr_matrix(block_diag(kernels)) if kernels else csr_matrix((0, 0))
        body = np.repeat([s.submesh.body for s in subdomains], [R.shape[1] for R in kernels])
        self.body = np.concatenate(comm.allgather(body)).astype(np.int64)
        pinned = [s.submesh.body for s in subdomains if s.submesh.pinned >= 0]
        self.pinned_body: int = comm.allreduce(max(pinned, default=-1), MPI.MAX)
        owned = jump_operator.owned[1] - jump_operator.owned[0]
        columns = np.arange(first, first + modes)
        self.G = assemble_owned_rows(comm, operators.B @ self.R, jump_operator.rows, columns, (owned, modes))
        self.factorizations = 0
        squares = np.asarray(self.G.power(2).sum(axis=0)).ravel()
        self._largest_diagonal = float(comm.allreduce(squares).max(initial=0.0))
        self.activate(np.ones(owned))

    def activate(self, active: Float) -> None:
        """Factor G^T G for the owned rows of which `active` is 1; the others, 0, carry no multiplier.  Collective.

        Motions that no active row resists, of a fibre that nothing holds, get a stiffness: G^T G + s Z Z^T.
        """
        self.G_active = (diags(active) @ self.G).tocsr()
        self.GT_active = self.G_active.T.tocsr()
        gram, self.unconstrained_modes = self._null_space((self.GT_active @ self.G_active).tocsr())
        if self.kernel_dimension:
            Z = self.unconstrained_modes
            regular = gram + self._largest_diagonal * csr_matrix(Z @ Z.T)
            self._solver = DirectSolver(regular.tocsr(), "feti_natural_")
            self.factorizations += 1

    def _null_space(self, part: csr_matrix) -> tuple[csr_matrix, Float]:
        """G^T G of active rows, of which this rank has a part, and its null space (m, z).  Collective."""
        gram = allreduce_sparse(self.comm, part)
        tolerance = UNCONSTRAINED_EIGENVALUE * self._largest_diagonal
        return gram, _null_space(gram, self.body, self.pinned_body, tolerance)

    @property
    def coarse_dimension(self) -> int:
        """Dimension of the space that every residual is orthogonal to."""
        return self.kernel_dimension

    @property
    def deflates(self) -> bool:
        """Whether more than rigid-body motions is taken out of the Krylov method."""
        return False

    def amplitudes(self, x: Float) -> Float:
        """(G^T G)^-1 G^T x on every rank, for the owned rows x (rows,) or (rows, k).  Collective."""
        return self._solver.solve(allreduce_sum(self.comm, self.GT_active @ x))

    def project(self, x: Float) -> Float:
        """P x for the owned rows x, whose inactive ones are 0: what no rigid-body motion works on.  Collective."""
        if not self.kernel_dimension:
            return x.copy()
        projected: Float = x - self.G_active @ self.amplitudes(x)
        return projected

    def free_motions(self, active: Float) -> Float:
        """(m, z) as `unconstrained_modes`, if those owned rows were active of which `active` is 1.  Collective."""
        G = (diags(active) @ self.G).tocsr()
        return self._null_space((G.T @ G).tocsr())[1]

    def rigid_body_motion(self, amplitudes: Float) -> Float:
        """R alpha on the boundary dofs, for alpha (m,) or (m, k)."""
        motion: Float = self.R @ amplitudes[self.owned_modes]
        return motion

    # As a `CoarseSpace` of its own: T = P.

    def deflate(self, z: Float) -> Float:
        """P z."""
        return self.project(z)

    def project_residual(self, r: Float) -> Float:
        """P r."""
        return self.project(r)

    def coarse_initial_guess(
        self, lam: Float, residual: Float, apply_dual: Callable[[Float], Float]
    ) -> tuple[Float, Float]:
        """lam and its residual as they are."""
        return lam, residual

    def disable_deflation(self) -> bool:
        """Nothing is deflated: False."""
        return False

    def destroy(self) -> None:
        """The factor is this rank's own and goes with the object."""


def _null_space(gram: csr_matrix, body: Int, pinned_body: int, tolerance: float) -> Float:
    """(m, z) orthonormal null space of G^T G (m, m): its eigenvectors of eigenvalues below `tolerance`.

    The pieces of the pinned body are glued to the pinned class and cannot move.  Of the others, those that are coupled
    in G^T G have an eigenproblem together, so each is about as large as a fibre's kernel; those of one size are solved
    at once.
    """
    movable = np.flatnonzero(body != pinned_body)
    coupling = gram[movable][:, movable].tocoo()
    number = np.unique(body[movable], return_inverse=True)[1]
    group = components(int(number.max(initial=-1)) + 1, number[coupling.row], number[coupling.col])[number]
    order = np.argsort(group, kind="stable")
    sizes, blocks = np.bincount(group), coupling.tocsr()
    starts = np.cumsum(sizes) - sizes
    null = [csr_matrix((len(body), 0))]
    for size in np.unique(sizes):
        members = order[starts[sizes == size][:, None] + np.arange(size)]
        values, vectors = np.linalg.eigh(_dense_blocks(blocks, members))
        which, mode = np.nonzero(values < tolerance)
        at = movable[members[which]].ravel(), np.repeat(np.arange(len(which)), size)
        null.append(csr_matrix((vectors[which, :, mode].ravel(), at), shape=(len(body), len(which))))
    return np.asarray(hstack(null).toarray())


def _dense_blocks(matrix: csr_matrix, members: Int) -> Float:
    """(b, m, m) dense blocks of the rows and columns `members` (b, m)."""
    rows, columns = np.broadcast_arrays(members[:, :, None], members[:, None, :])
    return np.asarray(matrix[rows.ravel(), columns.ravel()]).reshape(rows.shape)
