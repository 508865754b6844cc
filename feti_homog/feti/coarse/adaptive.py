"""The adaptive coarse space: rigid-body motions and soft subdomain modes, averaged over node copies.

Eliminating the coarse displacements Z_0 (`geneo.AveragedModes`) turns the boundary stiffness S, with springs, into

    S_0 = S - S Z_0 (Z_0^T S Z_0)^+ Z_0^T S,

and the preconditioner is H_0 = B_D S_0 B_D^T, B_D = W^-1 B D^-1 (`preconditioners`).  As B Z_0 = 0, H_0 inverts the
dual operator if Z_0 spans all displacements of the glued cell (THEORY.md, T9), and keeps the soft modes in Z_0 out of
the Krylov method (Spillane & Rixen, IJNME 95, 2013).  Z_0^T S Z_0 is semi-definite; it couples up to second neighbours.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy.sparse import csr_matrix, diags

from feti_homog.feti.coarse import geneo
from feti_homog.feti.decomposition.interface_neighbours import Neighbours
from feti_homog.feti.linalg.sparse_matrices import DistributedSolver, scaled, sum_of_blocks
from feti_homog.feti.operators.interface_operators import InterfaceOperators
from feti_homog.feti.operators.preconditioners import Dirichlet, Preconditioner, StiffnessScaled
from feti_homog.feti.thresholds import COARSE_REGULARISATIONS, DEFAULTS, ROUNDING_MARGIN, ZERO_TOLERANCE, Thresholds
from feti_homog.system.parallel import distributed_arrays
from feti_homog.system.runtime import process
from feti_homog.typing import Float, Int


class AdaptiveCoarseSpace:
    """The adaptive coarse space: S Z_0 on the local subdomains, and a factor of Z_0^T S Z_0.

    A rank stores only the u coarse displacements that reach its subdomains.  S Z_0 is dense on a subdomain: an uncut
    outer body has a column for every mode of every inner body.

    Attributes:
        threshold: bound tau of soft modes.
        counts: number of soft modes of each local subdomain.
        coarse_dimension: number n of coarse displacements in the cell.
        factorizations: number of factorizations of Z_0^T S Z_0.
        solver: solver for the scaled matrix Z_0^T S Z_0.
    """

    def __init__(
        self,
        operators: InterfaceOperators,
        scaling: StiffnessScaled,
        threshold: float,
        thresholds: Thresholds = DEFAULTS,
    ) -> None:
        """Compute the soft modes, and factor the coarse problem.  Collective.

        Soft modes have theta < `threshold`, see module `local_eigenproblems`.  Boundary operators must be dense where
        `operators.facewise` is false.  Options with the prefix `feti_coarse_` are as in `DistributedSolver`.

        Raises:
            MeshError: a face neighbourhood on some rank is not a valid subdomain.
            LinAlgError, MemoryError, CaseError: as in `factor`.
        """
        comm, jump_operator = operators.comm, operators.jump_operator
        self.comm, self.threshold = comm, threshold
        self._jump_operator, self._operators, self._scaling = jump_operator, operators, scaling
        self._neighbours = Neighbours(comm, jump_operator, operators.subdomains)
        blocks = geneo.subdomain_blocks(operators, scaling, self._neighbours.rows)
        V = geneo.kernels_and_soft_modes(blocks, self._neighbours, threshold, thresholds)
        process.trim_memory()
        self.counts = [v.shape[1] - b.R.shape[1] for v, b in zip(V, blocks, strict=True)]
        self._modes = geneo.AveragedModes(comm, blocks, self._neighbours, V)
        self.coarse_dimension = self._modes.total
        self.solver = DistributedSolver(comm, self.coarse_dimension, "feti_coarse_")
        self._columns = [np.searchsorted(self._modes.reaching, columns) for columns in self._modes.columns]
        self._translations = self._modes.translations(comm)
        # S Z_0 on the boundary dofs of each subdomain, and Z_0^T S Z_0.
        self._forces: list[Float] = [np.zeros((0, 0)) for _ in blocks]
        self._energies: list[Float] = [np.zeros((0, 0)) for _ in blocks]
        self._mask = np.ones(len(jump_operator.rows))
        self._solve_event = PETSc.Log.Event("FETICoarseSolve")
        self._update(range(len(blocks)), [block.BW for block in blocks])
        process.trim_memory()
        self.factorizations = 0
        self._free_energy: Float | None = None
        self.factor(self.part())

    def activate(self, active: Float) -> None:
        """Average the modes over node copies on active rows, and factor again.  Collective.

        Rows are active where `active` (owned rows,) is 1; activate the scaling first.  Raises like `factor`.
        """
        mask = self._jump_operator.gather(active).copy()
        changed = mask != self._mask
        touched = [i for i, rows in enumerate(self._neighbours.rows) if changed[rows].any()]
        BW = geneo.scaled_constraints(self._scaling)
        blocks = [geneo.local_columns(BW, self._operators.slices[i], self._neighbours.rows[i]) for i in touched]
        self._update(touched, blocks)
        self._mask = mask
        self.factor(self.part())

    def _update(self, which: Sequence[int], BW: Sequence[csr_matrix]) -> None:
        """Compute and store S Z_0 and Z_0^T S Z_0 of local subdomains `which`; `BW` are their scaled constraints."""
        for i, constraints in zip(which, BW, strict=True):
            Z = self._modes.of_subdomain(i, constraints)
            self._forces[i] = self._operators.with_springs[i].apply_schur(Z)
            self._energies[i] = Z.T @ self._forces[i]

    def part(self) -> csr_matrix:
        """Sum Z_0^T S Z_0 (u, u) over the local subdomains."""
        blocks = zip(self._columns, self._columns, self._energies, strict=True)
        return sum_of_blocks((len(self._modes.reaching),) * 2, blocks)

    def factor(self, part: csr_matrix) -> None:
        """Factor the coarse matrix Z_0^T S Z_0 of all ranks.  Collective.

        `part` (u, u) is the contribution of this rank.  The matrix is scaled to a unit diagonal.  Modes of a free fibre
        have no energy and get no equation; other modes may be linearly dependent.  Adding eps I, eps in
        COARSE_REGULARISATIONS, makes the matrix definite; S_0 then keeps the fraction eps / (mu + eps) of the forces of
        a mode with scaled energy mu.

        Raises:
            LinAlgError: rounding leaves the matrix indefinite with all COARSE_REGULARISATIONS.
            MemoryError, CaseError, FetiHomogError: as in `DistributedSolver.factor`.
        """
        self.factorizations += 1
        if not self.coarse_dimension:
            return
        energies = np.zeros(self.coarse_dimension)
        energies[self._modes.reaching] = part.diagonal()
        energy = distributed_arrays.allreduce_sum(self.comm, energies)[self._modes.reaching]
        if self._free_energy is None:
            largest = self.comm.allreduce(energy.max(initial=0.0), MPI.MAX)
            # Displacements that are pure rounding have an energy quadratic in the rounding.
            rounded = (ROUNDING_MARGIN * np.finfo(float).eps) ** 2 * largest
            self._free_energy = ZERO_TOLERANCE * np.where(energy > rounded, energy, largest)
        # The energy of a free motion is rounding, which the scaling would raise above eps.
        has_energy = energy > self._free_energy
        root = np.sqrt(np.where(has_energy, energy, 0.0))
        self._weights = np.divide(1.0, root, out=np.zeros_like(root), where=has_energy)
        matrix, near_kernel = scaled(part, self._weights), self._translations * root[:, None]
        for regularisation in COARSE_REGULARISATIONS:
            try:
                regularised = (matrix + diags(regularisation * self._modes.is_own)).tocsr()
                self.solver.factor(self._modes.reaching, regularised, near_kernel)
                return
            except np.linalg.LinAlgError:
                if regularisation == COARSE_REGULARISATIONS[-1]:
                    raise

    def balanced(self, x: Float) -> Float:
        """Compute the forces S_0 x of displacements x (boundary dofs,) or (boundary dofs, k).  Collective."""
        forces = self._operators.apply_with_springs(x)
        if not self.coarse_dimension:
            return forces
        work = np.zeros((len(self._modes.reaching), *x.shape[1:]))
        for columns, SZ, span in self._parts():
            work[columns] += SZ.T @ x[span]
        c = self.solve(work)
        for columns, SZ, span in self._parts():
            forces[span] -= SZ @ c[columns]
        return forces

    def solve(self, work: Float) -> Float:
        """Solve Z_0^T S Z_0 c = w for c (u, k); w is the sum of `work` (u, k) over ranks.  Collective."""
        with self._solve_event:
            right = distributed_arrays.scale_rows(self._weights, work)
            return distributed_arrays.scale_rows(self._weights, self.solver.solve(right))

    def _parts(self) -> zip[tuple[Int, Float, slice]]:
        """Iterate over subdomains: positions of modes in `AveragedModes.reaching`, S Z_0, slice of boundary dofs."""
        return zip(self._columns, self._forces, self._operators.slices, strict=True)

    def destroy(self) -> None:
        """Free the factor of the coarse matrix.  Collective."""
        self.solver.destroy()


class Balanced(Preconditioner):
    """The preconditioner H_0 = B_D S_0 B_D^T, with S_0 of `coarse` and B_D of `scaled`.

    For rigid-body motions R and G = B R, R - B_D^T G is in Z_0; S_0 R = S_0 Z_0 = 0, so G^T H_0 r = 0 and H_0 G = 0.

    Attributes:
        scaled: the preconditioner without coarse space.
        coarse: the coarse space.
    """

    def __init__(self, scaled: Dirichlet, coarse: AdaptiveCoarseSpace) -> None:
        self.scaled, self.coarse = scaled, coarse

    def activate(self, active: Float) -> None:
        """Restrict both parts to rows where `active` (owned rows,) is 1; raises like `coarse.activate`.  Collective."""
        self.scaled.activate(active)
        self.coarse.activate(active)

    def apply(self, r: Float) -> Float:
        """Compute H_0 r for r (owned rows,) or (owned rows, k).  Collective."""
        return self.scaled.multipliers(self.coarse.balanced(self.scaled.displacement_with_jump(r)))

    def closing_forces(self, jump: Float) -> Float:
        """Compute B_D S B_D^T `jump`, without the coarse space.  Collective."""
        return self.scaled.apply(jump)
