"""A distributed PETSc matrix out of the contributions of all ranks."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc
from scipy.sparse import csr_matrix

Int = NDArray[np.int64]


def assembled(
    comm: MPI.Intracomm, local: csr_matrix, rows: Int, columns: Int, owned: tuple[int, int]
) -> PETSc.Mat:
    """The sum over ranks of `local`, whose rows and columns have the given global numbers.

    Args:
        owned: numbers of rows and columns that this rank owns.
    """
    maps = [PETSc.LGMap().create(i.astype(PETSc.IntType), comm=comm) for i in (rows, columns)]
    sizes = tuple((n, comm.allreduce(n)) for n in owned)
    A = PETSc.Mat().createIS(sizes, *maps, comm=comm)
    csr = csr_matrix(local)
    A.setISLocalMat(
        PETSc.Mat().createAIJ(csr.shape, csr=(csr.indptr, csr.indices, csr.data), comm=PETSc.COMM_SELF)
    )
    A.assemble()
    return A.convert(PETSc.Mat.Type.AIJ)
