"""The few functions of PETSc's C interface that petsc4py 3.18 does not bind.

petsc4py's extension module resolves PETSc's symbols, so no library has to be found.
"""

from __future__ import annotations

import ctypes
from functools import cache

import numpy as np
from petsc4py import PETSc

from feti_homog.typing import Float

Pointer = ctypes.c_void_p


def option_was_used(name: str) -> bool:
    """Return whether any object has read the option `name` (without dash)."""
    used = ctypes.c_int()
    _call("PetscOptionsUsed", None, name.encode(), ctypes.byref(used))
    return bool(used.value)


def error_words(error: PETSc.Error) -> str:
    """Return the last line of an error of PETSc's, without the rank: what was wrong."""
    return str(error).splitlines()[-1].split("] ", 1)[-1]


def finalize() -> int:
    """End PETSc, which prints its logs; the error code, 0 if it could.  Collective over all ranks."""
    return int(_library().PetscFinalize())


def set_schur(factor: PETSc.Mat, rows: PETSc.IS) -> None:
    """Ask the factor matrix, before it is factored, to leave the Schur complement on `rows`."""
    _call("MatFactorSetSchurIS", Pointer(factor.handle), Pointer(rows.handle))


def schur_complement(factor: PETSc.Mat, size: int) -> Float:
    """Return the dense (size, size) Schur complement, in Fortran order, that a symmetric factorization has left."""
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
