"""The adaptive coarse space: soft modes of the subdomains deflated beside the rigid-body motions.

U = M^-1 B V for the kernels and the soft modes V of all subdomains, so U holds Q G with Q = M^-1.  A correction z keeps
what no coarse vector can do better,

    T z = z - U c,   [U^T F U   U^T G] [c]   [U^T F z]
                     [G^T U     0    ] [a] = [G^T z  ],

and a residual r loses the rigid-body part that makes U^T r vanish (Spillane & Rixen, IJNME 95, 2013, Section 5).
Once some rows are inactive, M^-1 is another and Q G no longer in its range; then G itself joins U.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum, auto

import numpy as np
from mpi4py import MPI
from scipy.sparse import csr_matrix, diags, hstack

from feti_homog.common import process_memory
from feti_homog.common.distributed_arrays import allreduce_sum, scale_rows
from feti_homog.feti.coarse.coarse_operator import CoarseOperator
from feti_homog.feti.coarse.deflation_vectors import deflation_vectors
from feti_homog.feti.coarse.geneo import kernels_and_soft_modes, subdomain_blocks
from feti_homog.feti.coarse.natural import NaturalCoarseSpace
from feti_homog.feti.decomposition.jump_operator import JumpOperator
from feti_homog.feti.decomposition.neighbours import Neighbours
from feti_homog.feti.linalg.distributed_matrix import add_shared_rows
from feti_homog.feti.linalg.saddle_point import SaddlePoint
from feti_homog.feti.operators.interface_operators import InterfaceOperators
from feti_homog.feti.preconditioners.scaled import StiffnessScaled
from feti_homog.feti.thresholds import DEFAULTS, MAX_PROJECTOR_ERROR, Thresholds
from feti_homog.typing import Float


class Deflation(Enum):
    """What the coarse vectors are used for.

    Every change of rows ends in one of the three:

        any -> OFF         too few active rows, a singular coarse matrix, or a T that is no projector
        any -> ORTHOGONAL  no row has been inactive yet, U is exact and the coarse matrix well conditioned
        any -> OBLIQUE     else

    and `disable_deflation` or `destroy` leads from any to OFF, which holds no factor.
    """

    OFF = auto()
    """T = P for corrections and residuals."""
    ORTHOGONAL = auto()
    """T for corrections, P for residuals: U has M^-1 G in its range, so T M^-1 takes away what P leaves."""
    OBLIQUE = auto()
    """T for corrections, r - G a with U^T (r - G a) = 0 for residuals."""


class AdaptiveCoarseSpace:
    """The coarse space of this module, a `CoarseSpace`.  Every rank holds its rows of U and a factor.

    Attributes:
        natural: the rigid-body motions, G and P.
        threshold: tau.
        counts: soft modes of each of this rank's subdomains.
        operator: U, and E = U^T F U.
        state: what they are used for.
    """

    def __init__(
        self,
        comm: MPI.Intracomm,
        jump_operator: JumpOperator,
        operators: InterfaceOperators,
        scaling: StiffnessScaled,
        natural: NaturalCoarseSpace,
        threshold: float,
        compliance: Float,
        thresholds: Thresholds = DEFAULTS,
    ) -> None:
        """Find the modes below the threshold tau and factor.  All boundary operators must be dense but of large
        bodies.  Options under `feti_coarse_` (default: cholesky by CHOLMOD, on all ranks together by MUMPS).
        Collective."""
        self.comm, self.jump_operator, self.natural = comm, jump_operator, natural
        self.threshold, self._thresholds = threshold, thresholds
        neighbours = Neighbours(comm, jump_operator, operators.subdomains)
        blocks = subdomain_blocks(comm, jump_operator, operators, scaling, neighbours.rows)
        V = kernels_and_soft_modes(blocks, neighbours, threshold, thresholds)
        process_memory.trim()
        self.counts = [v.shape[1] - b.R.shape[1] for v, b in zip(V, blocks, strict=True)]
        # The smallest entries of U are dropped for large bodies, and U knows no springs where all bodies are cut.
        self._is_exact = not comm.allreduce(any(operators.facewise) or bool(operators.compliance.any()), MPI.LOR)
        self._includes_G = False
        self._G_local = _local_motions(operators, natural)
        self._saddle: SaddlePoint | None = None
        self.state = Deflation.OFF
        U = deflation_vectors(comm, jump_operator, blocks, neighbours, V, thresholds.drop_tolerance)
        process_memory.trim()
        self.operator = CoarseOperator(jump_operator, operators, blocks, neighbours.rows, U, compliance)
        self._active = np.ones(self.operator.U.shape[0])
        self.factor()

    @property
    def coarse_dimension(self) -> int:
        """Dimension of the space that every residual is orthogonal to."""
        return self.operator.vectors

    @property
    def deflates(self) -> bool:
        """Whether the coarse vectors are in use."""
        return self.state is not Deflation.OFF

    @property
    def saddle(self) -> SaddlePoint:
        """The factored coarse problem.

        Raises:
            RuntimeError: deflation is off.
        """
        if self._saddle is None:
            raise RuntimeError("the coarse problem is not factored: deflation is off")
        return self._saddle

    def activate(self, active: Float) -> None:
        """Factor for the owned rows of which `active` is 1; U is restricted to them.  Collective."""
        self.natural.activate(active)
        if not self._includes_G:
            jump_operator = self.jump_operator
            G = add_shared_rows(self.comm, self._G_local, jump_operator.rows, jump_operator.is_shared_row, len(active))
            self._includes_G = True
            self.operator.set_vectors(hstack([self.operator.U_local, G]).tocsr())
        self.operator.activate(active)
        self._active = active
        self.factor()

    def factor(self) -> None:
        """Factor the coarse matrix of the active rows, and choose the state.  Collective."""
        self.destroy()
        rows = int(allreduce_sum(self.comm, np.array([self._active.sum()]))[0])
        few = rows < self._thresholds.rows_per_vector * self.coarse_dimension
        if not self.coarse_dimension or few or not self._factor_saddle():
            return
        self.state = Deflation.OBLIQUE
        if not self._deflation_is_projector():
            self.destroy()
        elif self._is_exact and self.saddle.well_conditioned and not self._includes_G:
            self.state = Deflation.ORTHOGONAL

    def disable_deflation(self) -> bool:
        """Leave it at rigid-body motions until rows change; whether that is a change.  Collective."""
        deflated = self.deflates
        self.destroy()
        return deflated

    def destroy(self) -> None:
        """Free the factor and turn deflation off.  Collective."""
        self.state = Deflation.OFF
        if self._saddle is not None:
            self._saddle.destroy()
            self._saddle = None

    def project(self, x: Float) -> Float:
        """P x."""
        return self.natural.project(x)

    def deflate(self, z: Float) -> Float:
        """T z."""
        if self.state is Deflation.OFF:
            return self.natural.project(z)
        c, _ = self._solve(self.operator.energy(z), self.natural.GT_active @ z)
        return z - scale_rows(self._active, self.operator.U @ c)

    def project_residual(self, r: Float) -> Float:
        """r - G a with U^T (r - G a) = 0 as far as that can be; or P r, where that does as well."""
        if self.state is not Deflation.OBLIQUE:
            return self.natural.project(r)
        _, a = self._solve(self.operator.U.T @ r, np.zeros((self.natural.kernel_dimension, *r.shape[1:])))
        projected: Float = r - self.natural.G_active @ a
        return projected

    def coarse_initial_guess(
        self, lam: Float, residual: Float, apply_dual: Callable[[Float], Float]
    ) -> tuple[Float, Float]:
        """lam + U c with U^T (r - F U c - G a) = 0 and G^T U c = 0, and its residual."""
        if self.state is Deflation.OFF:
            return lam, residual
        no_work = np.zeros((self.natural.kernel_dimension, *residual.shape[1:]))
        c, _ = self._solve(self.operator.U.T @ residual, no_work)
        z = scale_rows(self._active, self.operator.U @ c)
        return lam + z, self.project_residual(residual - apply_dual(z))

    def _solve(self, f: Float, g: Float) -> tuple[Float, Float]:
        """c and a of the coarse problem whose right-hand sides are the sums over ranks of f and g."""
        right = allreduce_sum(self.comm, np.concatenate([f, g]))
        return self.saddle.solve(right[: self.coarse_dimension], right[self.coarse_dimension :])

    def _factor_saddle(self) -> bool:
        """Factor the coarse matrix; whether it could be."""
        matrices = self.matrices()
        process_memory.trim()
        try:
            self._saddle = SaddlePoint(self.comm, *matrices, "feti_coarse_", self.is_replicated)
        except np.linalg.LinAlgError:
            return False
        return True

    @property
    def is_replicated(self) -> bool:
        """Whether every rank has a factor of its own."""
        return self._thresholds.replicates(self.coarse_dimension, self.comm.size)

    def matrices(self) -> tuple[csr_matrix, csr_matrix, csr_matrix]:
        """This rank's parts of E and K = G^T U, zero rows and unconstrained motions made regular, and the projector to
        those motions.  Collective."""
        U, GT = self.operator.U, self.natural.GT_active
        nonzero = allreduce_sum(self.comm, abs(U.T) @ self._active) > 0.0
        E, K = self.operator.E, (GT @ U).tocsr()
        if not nonzero.all():
            mask = diags(nonzero.astype(float))
            E, K = mask @ E @ mask, K @ mask
        unconstrained = self.natural.unconstrained_projector
        if self.comm.rank == 0:
            E = E + diags((~nonzero).astype(float))
        if self._includes_G:
            # No force acts on the columns of G that nothing resists.
            first = self.coarse_dimension - self.natural.kernel_dimension
            stiffness = allreduce_sum(self.comm, E.diagonal())[first:].mean()
            at = unconstrained.tocoo()
            if self.comm.rank == 0:
                E = E + csr_matrix((stiffness * at.data, (at.row + first, at.col + first)), shape=E.shape)
        return E.tocsr(), K.tocsr(), unconstrained

    def _deflation_is_projector(self) -> bool:
        """Whether T T z = T z and G^T T z = 0 for some z, to MAX_PROJECTOR_ERROR.

        With few active rows the columns of U depend on each other and the coarse matrix is singular.
        """
        z = self._active * np.cos(np.arange(len(self._active)) + 1.0)
        once = self.deflate(z)
        twice = self.deflate(once)
        GT = self.natural.GT_active
        before, after = (np.abs(allreduce_sum(self.comm, GT @ x)).max(initial=0.0) for x in (z, once))
        size, change = allreduce_sum(self.comm, np.array([once @ once, (twice - once) @ (twice - once)]))
        return bool(after <= MAX_PROJECTOR_ERROR * before and change <= MAX_PROJECTOR_ERROR**2 * size)


def _local_motions(operators: InterfaceOperators, natural: NaturalCoarseSpace) -> csr_matrix:
    """(local rows, kernel modes) this rank's part of G = B R."""
    own = (operators.B @ natural.R).tocsr()
    shape = (own.shape[0], natural.kernel_dimension)
    return csr_matrix((own.data, own.indices + natural.owned_modes.start, own.indptr), shape=shape)
