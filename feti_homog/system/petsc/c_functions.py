"""Call functions of PETSc's C interface that petsc4py 3.18 does not bind, and keep exceptions of callbacks.

The extension module of petsc4py resolves PETSc's symbols, so that no library search is needed.
"""

import ctypes
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from typing import TypeVar

import numpy as np
from mpi4py.MPI import Comm
from petsc4py import PETSc

from feti_homog.system.parallel.mpi_errors import all_raise, end_job
from feti_homog.typing import Float

Pointer = ctypes.c_void_p
T = TypeVar("T")


def option_was_used(name: str) -> bool:
    """Return whether any object has read the option `name` (without dash)."""
    used = ctypes.c_int()
    _call("PetscOptionsUsed", None, name.encode(), ctypes.byref(used))
    return bool(used.value)


def error_words(error: PETSc.Error) -> str:
    """Return the fault in a PETSc error: the last line, without the rank."""
    return str(error).splitlines()[-1].split("] ", 1)[-1]


def finalize() -> int:
    """End PETSc, which writes its logs; return the error code, 0 for success.  Collective."""
    return int(_library().PetscFinalize())


def set_schur(factor: PETSc.Mat, rows: PETSc.IS) -> None:
    """Request the Schur complement on `rows` from a factor matrix, before its factorization."""
    _call("MatFactorSetSchurIS", Pointer(factor.handle), Pointer(rows.handle))


def schur_complement(factor: PETSc.Mat, size: int) -> Float:
    """Copy the Schur complement (size, size), in Fortran order, from a symmetric factorization."""
    schur, values = Pointer(), ctypes.POINTER(ctypes.c_double)()
    _call("MatFactorCreateSchurComplement", Pointer(factor.handle), ctypes.byref(schur), None)
    try:
        _call("MatDenseGetArrayRead", schur, ctypes.byref(values))
        return np.ctypeslib.as_array(values, (size, size)).T.copy(order="F")
    finally:
        _call("MatDestroy", ctypes.byref(schur))


def _call(function: str, *arguments: object) -> None:
    code = getattr(_library(), function)(*arguments)
    if code:
        raise PETSc.Error(code)


@cache
def _library() -> ctypes.CDLL:
    return ctypes.CDLL(PETSc.__file__)


class CallbackErrors:
    """A guard for callbacks of PETSc: stores the first exception until PETSc has returned.

    No exception may pass through PETSc's C code: petsc4py 3.22 crashes.  Instead the callback, and all later callbacks,
    return a value that ends PETSc's method, such as NaN, until `raised` raises the exception.
    """

    def __init__(self, comm: Comm) -> None:
        self._comm = comm
        self._error: BaseException | None = None

    def call(self, function: Callable[[], T], otherwise: T) -> T:
        """Return function(), or `otherwise` after an exception in this or an earlier call.  Collective.

        A FetiHomogError that all ranks raise is stored on all ranks.  A rank that raises alone, or has a defect, ends
        the job, because the other ranks would wait within `function`.
        """
        if self._error is not None:
            return otherwise
        try:
            return function()
        except BaseException as error:
            if self._comm.size > 1 and not all_raise(self._comm, error):
                end_job(self._comm, error)
            self._error = error
            return otherwise

    @contextmanager
    def raised(self) -> Iterator[None]:
        """Context manager for calls of PETSc: at the end, raise and clear the stored exception, else PETSc's error."""
        try:
            yield
        except PETSc.Error:
            if self._error is None:
                raise
        error, self._error = self._error, None
        if error is not None:
            raise error
