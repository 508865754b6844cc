"""The adaptive coarse space: rigid-body motions and soft modes of the subdomains, averaged over copies of each node.

With the coarse displacements Z of `averaged_modes`, the stiffness S of the boundaries becomes

    S_0 = S - S Z (Z^T S Z)^-1 Z^T S,

what is left of it where the coarse displacements have found their equilibrium.  As B Z = 0, S_0 in place of S in the
preconditioner M^-1 = B_D S B_D^T makes the exact inverse of the dual operator if Z spans all displacements of the glued
cell (T9), and takes the soft modes away from the Krylov method if it spans theirs (Spillane & Rixen, IJNME 95, 2013).
Z^T S Z is definite, and couples a subdomain with those that share a neighbour with it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from mpi4py import MPI
from scipy.sparse import csr_matrix, diags

from feti_homog.common import process_memory
from feti_homog.common.distributed_arrays import allreduce_sum, scale_rows
from feti_homog.feti.coarse.averaged_modes import AveragedModes
from feti_homog.feti.coarse.geneo import kernels_and_soft_modes, local_columns, scaled_constraints, subdomain_blocks
from feti_homog.feti.decomposition.jump_operator import JumpOperator
from feti_homog.feti.decomposition.neighbours import Neighbours
from feti_homog.feti.linalg.dense_block_sum import DenseBlockSum
from feti_homog.feti.linalg.distributed_direct import DistributedDirectSolver, ReplicatedDirectSolver, direct_solver
from feti_homog.feti.linalg.scaled_sparse import scaled
from feti_homog.feti.operators.interface_operators import InterfaceOperators
from feti_homog.feti.preconditioners.scaled import StiffnessScaled
from feti_homog.feti.thresholds import COARSE_REGULARISATION, DEFAULTS, FREE_MODE_ENERGY, Thresholds
from feti_homog.typing import Float, Int


class AdaptiveCoarseSpace:
    """The coarse space of this module.  Every rank has S Z on its subdomains, and a factor or its part of one.

    Attributes:
        threshold: tau.
        counts: soft modes of each of this rank's subdomains.
        coarse_dimension: coarse displacements, n.
        factorizations: of Z^T S Z so far.
    """

    def __init__(
        self,
        comm: MPI.Intracomm,
        jump_operator: JumpOperator,
        operators: InterfaceOperators,
        scaling: StiffnessScaled,
        threshold: float,
        thresholds: Thresholds = DEFAULTS,
    ) -> None:
        """Find the modes below the threshold tau and factor.  All boundary operators must be dense but of large
        bodies.  Options under `feti_coarse_` (default: cholesky by CHOLMOD, on all ranks together by MUMPS).
        Collective."""
        self.comm, self.threshold = comm, threshold
        self._jump_operator, self._operators, self._scaling = jump_operator, operators, scaling
        self._neighbours = Neighbours(comm, jump_operator, operators.subdomains)
        blocks = subdomain_blocks(comm, jump_operator, operators, scaling, self._neighbours.rows)
        V = kernels_and_soft_modes(blocks, self._neighbours, threshold, thresholds)
        process_memory.trim()
        self.counts = [v.shape[1] - b.R.shape[1] for v, b in zip(V, blocks, strict=True)]
        self._modes = AveragedModes(comm, blocks, self._neighbours, V)
        self.coarse_dimension = self._modes.total
        self.is_replicated = thresholds.replicates(self.coarse_dimension, comm.size)
        self._translations = self._modes.translations(comm)
        # Of each subdomain S Z on its boundary dofs, and Z^T S Z.
        self._forces: list[Float] = [np.zeros((0, 0)) for _ in blocks]
        self._energies: list[Float] = [np.zeros((0, 0)) for _ in blocks]
        self._mask = np.ones(len(jump_operator.rows))
        self._update(range(len(blocks)), [block.BW for block in blocks])
        process_memory.trim()
        self.factorizations = 0
        self._solver: ReplicatedDirectSolver | DistributedDirectSolver | None = None
        part = self.part()
        self._bonded_energy = allreduce_sum(comm, part.diagonal())
        self.factor(part)

    def activate(self, active: Float) -> None:
        """Average over the copies that the owned rows hold together of which `active` is 1, those of the scaling, and
        factor.  Collective."""
        mask = self._jump_operator.gather(active).copy()
        changed = mask != self._mask
        touched = [i for i, rows in enumerate(self._neighbours.rows) if changed[rows].any()]
        BW = scaled_constraints(self.comm, self._jump_operator, self._scaling)
        of = [local_columns(BW, self._operators.slices[i], self._neighbours.rows[i]) for i in touched]
        self._update(touched, of)
        self._mask = mask
        self.factor(self.part())

    def _update(self, which: Sequence[int], BW: Sequence[csr_matrix]) -> None:
        """S Z and Z^T S Z of some subdomains, for their scaled constraints."""
        for i, constraints in zip(which, BW, strict=True):
            Z = self._modes.of_subdomain(i, constraints)
            self._forces[i] = self._operators.skins[i].apply_schur(Z)
            self._energies[i] = Z.T @ self._forces[i]

    def part(self) -> csr_matrix:
        """(n, n) this rank's part of Z^T S Z."""
        total = DenseBlockSum((self.coarse_dimension, self.coarse_dimension))
        for columns, energy in zip(self._modes.columns, self._energies, strict=True):
            total.add(columns, columns, energy)
        return total.matrix()

    def factor(self, part: csr_matrix) -> None:
        """Factor Z^T S Z, the sum of all parts, scaled to a unit diagonal, with a small multiple of the identity.
        Collective.

        Averaged modes may depend on each other, and those of a fibre that nothing holds have no energy.  What is added
        makes the sum definite, and S_0 greater by as little.
        """
        self.destroy()
        energy = allreduce_sum(self.comm, part.diagonal())
        self._weights = 1.0 / np.sqrt(np.maximum(energy, FREE_MODE_ENERGY * self._bonded_energy))
        matrix = scaled(part, self._weights) + diags(COARSE_REGULARISATION * self._modes.is_own)
        near_kernel = np.linalg.qr(self._translations / self._weights[:, None])[0]
        self._solver = direct_solver(self.comm, matrix.tocsr(), "feti_coarse_", self.is_replicated, near_kernel)
        self.factorizations += 1

    def balanced(self, x: Float) -> Float:
        """The forces S_0 x (boundary dofs,) or (boundary dofs, k) of displacements x of that shape.  Collective."""
        work = np.zeros((self.coarse_dimension, *x.shape[1:]))
        for columns, SZ, span in self._parts():
            work[columns] += SZ.T @ x[span]
        c, forces = self.solve(allreduce_sum(self.comm, work)), self._operators.apply_skin(x)
        for columns, SZ, span in self._parts():
            forces[span] -= SZ @ c[columns]
        return forces

    def solve(self, work: Float) -> Float:
        """c with Z^T S Z c = work, (n,) or (n, k) on every rank.  Collective."""
        assert self._solver is not None, "the factor is destroyed"
        return scale_rows(self._weights, self._solver.solve(scale_rows(self._weights, work)))

    @property
    def inner_iterations(self) -> int:
        """Iterations of the last solve, of one column: 1 with a factor."""
        return 0 if self._solver is None else self._solver.iterations

    def _parts(self) -> zip[tuple[Int, Float, slice]]:
        """Of each subdomain the modes that reach it, S Z, and where it is among the boundary dofs."""
        return zip(self._modes.columns, self._forces, self._operators.slices, strict=True)

    def destroy(self) -> None:
        """Free the factor.  Collective."""
        if self._solver is not None:
            self._solver.destroy()
            self._solver = None
