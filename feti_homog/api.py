"""Computing a case from a program of one's own; PETSc starts when the first case is run."""

from __future__ import annotations

import os
import sys
from typing import TYPE_CHECKING

from feti_homog.config.case import Case

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

    from feti_homog.analysis.result import Result


def run(case: Case, comm: Intracomm | None = None) -> Result:
    """The result of a case on every rank of `comm` (default: all ranks); nothing is written or printed.

    Collective over `comm`; ranks outside of it need not call it, nor wait.  If the program has not started PETSc,
    this does, without options: those of the case are in its `petsc`.

    Raises:
        CaseError, MeshError: the case cannot be run.
        ConvergenceError: a solve did not converge or a check failed.
    """
    os.environ.setdefault("H5PY_ALWAYS_USE_MPI", "1")
    from mpi4py import MPI

    comm = MPI.COMM_WORLD if comm is None else comm
    if "petsc4py.PETSc" not in sys.modules:
        import petsc4py

        # On more ranks it would wait for those that run no case, or have run one; cases bring their own communicator.
        petsc4py.init([], comm=MPI.COMM_SELF)
    from feti_homog.analysis.runner import compute

    return compute(case, comm)
