"""The natural coarse problem: G = B R, the projector P = I - G (G^T G)^-1 G^T and the rigid-body amplitudes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc
from scipy.sparse import block_diag, csr_matrix

from feti_homog.feti.assembled import assembled
from feti_homog.feti.constraints import Constraints

Float = NDArray[np.float64]


class CoarseProblem:
    """Solvability of all subdomains, Eq. (37): G^T lam = e with e = R^T f.

    G has a row a multiplier and a column a kernel mode; G^T G is factored once, redundantly on every rank.
    """

    def __init__(self, comm: MPI.Comm, constraints: Constraints, kernels: Sequence[Float]) -> None:
        self.R = csr_matrix(block_diag(kernels)) if kernels else csr_matrix((0, 0))
        modes = sum(R.shape[1] for R in kernels)
        first = comm.exscan(modes) or 0
        self.dimension = comm.allreduce(modes)
        owned = constraints.owned[1] - constraints.owned[0]
        self.G = assembled(
            comm, constraints.B @ self.R, constraints.rows, first + np.arange(modes), (owned, modes)
        )
        self._amplitude, self._rhs = self.G.createVecRight(), self.G.createVecRight()
        self._along = self.G.createVecLeft()
        self._ksp = _factorized(self.G.transposeMatMult(self.G)) if self.dimension else None

    def apply(self, x: PETSc.Vec) -> None:
        """x <- P x, the part of x that no rigid-body motion works on."""
        if self._ksp is not None:
            self.amplitudes(x, self._amplitude)
            self.G.mult(self._amplitude, self._along)
            x.axpy(-1.0, self._along)

    def amplitudes(self, x: PETSc.Vec, alpha: PETSc.Vec) -> None:
        """alpha = (G^T G)^-1 G^T x."""
        if self._ksp is not None:
            self.G.multTranspose(x, self._rhs)
            self._ksp.solve(self._rhs, alpha)

    def balance(self, f: Float, lam: PETSc.Vec) -> None:
        """lam = G (G^T G)^-1 R^T f: the smallest multipliers that keep every subdomain in equilibrium."""
        lam.zeroEntries()
        if self._ksp is not None:
            self._rhs.getArray()[:] = self.R.T @ f
            self._ksp.solve(self._rhs, self._amplitude)
            self.G.mult(self._amplitude, lam)

    def rigid_motion(self, x: PETSc.Vec) -> Float:
        """R alpha on this rank, with alpha = (G^T G)^-1 G^T x."""
        self.amplitudes(x, self._amplitude)
        return self.R @ self._amplitude.getArray(readonly=True)

    def view(self, viewer: PETSc.Viewer | None = None) -> None:
        """Print the size of the coarse problem and its solver."""
        PETSc.Sys.Print(f"FETI coarse problem: {self.dimension} kernel modes, {self.G.size[0]} multipliers")
        if self._ksp is not None:
            self._ksp.view(viewer)


def _factorized(matrix: PETSc.Mat) -> PETSc.KSP:
    matrix.setOption(PETSc.Mat.Option.SPD, True)
    ksp = PETSc.KSP().create(matrix.comm)
    ksp.setOptionsPrefix("feti_coarse_")
    ksp.setOperators(matrix)
    ksp.setType(PETSc.KSP.Type.PREONLY)
    ksp.setErrorIfNotConverged(True)
    ksp.getPC().setType(PETSc.PC.Type.REDUNDANT)
    options = PETSc.Options("feti_coarse_redundant_")
    for name, value in (("ksp_type", "preonly"), ("pc_type", "cholesky"), ("pc_factor_mat_solver_type", "cholmod")):
        if not options.hasName(name):
            options[name] = value
    ksp.setFromOptions()
    ksp.setUp()
    return ksp
