"""Direct and iterative solvers for sparse matrices that are sums over ranks, through PETSc's KSP and PC."""

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy.sparse import csr_matrix

from feti_homog.feti.linalg.sparse_direct import factored, is_direct, power_of_two, sequential, solve_columns
from feti_homog.feti.linalg.sparse_matrices import assemble_distributed, gathered_sum
from feti_homog.feti.thresholds import REPLICATED_UNKNOWNS
from feti_homog.system.parallel import distributed_arrays
from feti_homog.typing import Float, Int


class DistributedSolver:
    """Solver X = A^-1 B for a definite matrix A (n, n), a sum over ranks that may be replaced.

    Every rank factors a whole small matrix, by CHOLMOD; all ranks together factor a large matrix, by MUMPS.  Options
    under the prefix choose other solvers; with `ksp_type` or `pc_type` all ranks solve together.
    """

    def __init__(self, comm: MPI.Intracomm, total: int, prefix: str, most_whole: int = REPLICATED_UNKNOWNS) -> None:
        """Choose the solver for n = `total`: up to n = `most_whole`, every rank factors the whole matrix."""
        self.comm, self.total, self._prefix = comm, total, prefix
        self._ksp: PETSc.KSP | None = None
        options = PETSc.Options(prefix)
        together = total > most_whole or any(options.hasName(name) for name in ("ksp_type", "pc_type"))
        self.is_distributed = comm.size > 1 and together

    def factor(self, unknowns: Int, part: csr_matrix, near_kernel: Float | None = None) -> None:
        """Assemble and factor A, and free the last factor.  Collective.

        Args:
            unknowns: (u,) numbers of the local unknowns, ascending; ranks may have unknowns in common.
            part: (u, u) this rank's part of the sum.
            near_kernel: (u, c) vectors with little energy, for multigrid.

        Raises:
            LinAlgError: A is not positive definite on some rank, for rounding may differ between processors; all
                ranks raise the error.
            MemoryError, CaseError: as `factored`.
        """
        self.destroy()
        error = None
        self._unknowns = unknowns
        try:
            if self.is_distributed:
                matrix = assemble_distributed(self.comm, part, unknowns, self.total)
            else:
                matrix = sequential(gathered_sum(self.comm, part, unknowns, self.total))
            self._scale = power_of_two(matrix.getDiagonal().getArray(readonly=True), self.comm)
            matrix.scale(self._scale)
            library = PETSc.Mat.SolverType.MUMPS if self.is_distributed else PETSc.Mat.SolverType.CHOLMOD
            if near_kernel is not None:
                # A basis (n, m), without zero columns and equal on all ranks.
                mean = self._sum(near_kernel) / np.maximum(self._sum(np.ones((len(near_kernel), 1))), 1.0)
                near_kernel = np.linalg.qr(mean[:, mean.any(axis=0)])[0]
            # Before a factor that may fail on one rank alone.
            self._x, self._b = matrix.createVecs()
            self._ksp = factored(matrix, self._prefix, library, near_kernel)
        except np.linalg.LinAlgError as caught:
            error = caught
        if self.comm.allreduce(error is not None, MPI.LOR):
            # Left to PETSc's garbage collection: a rank that failed alone could not take part in `destroy`.
            self._ksp = None
            raise np.linalg.LinAlgError(f"a coarse matrix is singular: {error or 'on another rank'}") from error

    def solve(self, B: Float) -> Float:
        """Solve for right-hand sides summed over ranks; return the local unknowns.  Collective.

        Each rank passes its part B (u,) or (u, k) of the right-hand sides.
        """
        assert self._ksp is not None, "nothing is factored"
        right = self._sum(B if B.ndim == 2 else B[:, None])[slice(*self._b.getOwnershipRange())]
        X = solve_columns(self._ksp, self._x, self._b, right)
        X *= self._scale
        if self.is_distributed:
            X = distributed_arrays.allgather_rows(self.comm, X, np.diff(self._b.getOwnershipRanges()))
        return np.asarray(X[self._unknowns]).reshape(B.shape)

    def _sum(self, B: Float) -> Float:
        """Sum right-hand sides B (u, k) over ranks: (n, k)."""
        part = np.zeros((self.total, B.shape[1]))
        part[self._unknowns] = B
        return distributed_arrays.allreduce_sum(self.comm, part)

    @property
    def iterations(self) -> int:
        """Iterations of the last solve for one column by an iterative method; 1 for a direct method."""
        assert self._ksp is not None, "nothing is factored"
        return 1 if is_direct(self._ksp) else int(self._ksp.getIterationNumber())

    def destroy(self) -> None:
        """Free the factor.  Collective."""
        if self._ksp is not None:
            for petsc_object in (self._ksp.getOperators()[0], self._ksp, self._x, self._b):
                petsc_object.destroy()
            self._ksp = None
