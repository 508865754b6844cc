"""Partial Cholesky factorizations by PETSc's CHOLMOD library; PETSc has no interface for them.

MUMPS orders the eliminated rows without regard to the remaining rows, and is slower if many rows remain.  CHOLMOD
accepts an order of all rows.  The structures below follow CHOLMOD's manual, and are the same in KNOWN_VERSIONS.
"""

import ctypes
import weakref
from contextlib import suppress
from ctypes import POINTER, byref, c_double, c_int, c_size_t, c_void_p
from enum import IntEnum
from functools import cache
from typing import Any

import numpy as np
from petsc4py import PETSc
from scipy.sparse import csr_matrix

from feti_homog.typing import Array, Float, Int

# Bytes for the structure `cholmod_common`, which takes less than 4 KiB; this module reads none of its members.
COMMON_BYTES = 2**16
GIVEN, LOWER = 1, -1  # CHOLMOD_GIVEN: the caller orders the rows; stype: the lower triangle is stored
KNOWN_VERSIONS = range(2, 6)


class System(IntEnum):
    """The system that `cholmod_solve` solves: A x = b or L x = b."""

    A, L = 0, 4


class XType(IntEnum):
    """The content of a CHOLMOD matrix: only the positions of entries, or positions and values."""

    PATTERN, REAL = 0, 1


class _Sparse(ctypes.Structure):
    """CHOLMOD's structure `cholmod_sparse`."""

    _fields_ = (
        *((name, c_size_t) for name in ("nrow", "ncol", "nzmax")),
        *((name, c_void_p) for name in ("p", "i", "nz", "x", "z")),
        *((name, c_int) for name in ("stype", "itype", "xtype", "dtype", "sorted", "packed")),
    )


class _Dense(ctypes.Structure):
    """CHOLMOD's structure `cholmod_dense`."""

    _fields_ = (
        *((name, c_size_t) for name in ("nrow", "ncol", "nzmax", "d")),
        *((name, c_void_p) for name in ("x", "z")),
        *((name, c_int) for name in ("xtype", "dtype")),
    )


class _Factor(ctypes.Structure):
    """CHOLMOD's structure `cholmod_factor`."""

    _fields_ = (
        *((name, c_size_t) for name in ("n", "minor")),
        *((name, c_void_p) for name in ("Perm", "ColCount", "IPerm")),
        ("nzmax", c_size_t),
        *((name, c_void_p) for name in ("p", "i", "x", "z", "nz", "next", "prev")),
        *((name, c_size_t) for name in ("nsuper", "ssize", "xsize", "maxcsize", "maxesize")),
        *((name, c_void_p) for name in ("super", "pi", "px", "s")),
        *((name, c_int) for name in ("ordering", "is_ll", "is_super", "is_monotonic")),
        *((name, c_int) for name in ("itype", "xtype", "dtype", "useGPU")),
    )


@cache
def is_available() -> bool:
    """Return whether PETSc is linked with a known version of CHOLMOD."""
    version = (c_int * 3)()
    try:
        _library().cholmod_version(version)
    except AttributeError:
        return False
    return version[0] in KNOWN_VERSIONS


class PartialFactor:
    """The Cholesky factor L of A = L L^T (n, n), with rows of A permuted so that m chosen rows come last.

    The destructor of this object frees the factor.
    """

    def __init__(self, A: csr_matrix, rows: Int, order: Int) -> None:
        """Factor A (n, n), and sort its indices in place; `rows` (m,) come last, other rows follow `order` (n,).

        Raises:
            LinAlgError: A is not positive definite.
            MemoryError: CHOLMOD cannot factor, usually for lack of memory.
        """
        n, is_last = A.shape[0], np.zeros(A.shape[0], bool)
        is_last[rows] = True
        A.sort_indices()
        # CHOLMOD reads these arrays in place.
        p, i = (indices.astype(np.int32, copy=False) for indices in (A.indptr, A.indices))
        x = np.asarray(A.data, np.float64)
        matrix = _Sparse(n, n, A.nnz, _address(p), _address(i), None, _address(x), None, LOWER, 0, XType.REAL, 0, 1, 1)
        # The requested order of rows; CHOLMOD eliminates row `_order[k]` at step `_place[k]`.
        self._order, self._m = np.r_[order[~is_last[order]], rows], len(rows)
        self._common = common = ctypes.create_string_buffer(COMMON_BYTES)
        library = _library()
        library.cholmod_start(common)
        self._factor = library.cholmod_allocate_factor(c_size_t(n), common)
        # The factor is freed before the workspace: the last callback is called first.
        weakref.finalize(self, library.cholmod_finish, common)
        weakref.finalize(self, library.cholmod_free_factor, byref(self._factor), common)
        # Analyse the matrix in a postordering of the elimination tree, with the fill of the requested order.
        requested = self._order.astype(np.int32)
        parent, post, count, *work = np.empty((5, n), np.int32)
        done = library.cholmod_analyze_ordering(
            byref(matrix), GIVEN, _address(requested), None, c_size_t(0),
            *map(_address, (parent, post, count, *work)), common,
        )  # fmt: skip
        if not (done and self._factor):
            raise MemoryError("CHOLMOD cannot analyse a matrix, probably for lack of memory")
        self._place = np.empty(n, np.int64)
        self._place[post] = np.arange(n)
        parent = np.where(parent[post] < 0, -1, self._place[parent[post]]).astype(np.int32)
        permuted = np.ascontiguousarray(requested[post])
        factor = self._factor.contents
        _array(factor.Perm, n, c_int)[:] = permuted
        _array(factor.ColCount, n, c_int)[:] = count[post]
        factor.ordering = GIVEN
        upper = library.cholmod_ptranspose(byref(matrix), XType.PATTERN, _address(permuted), None, c_size_t(0), common)
        done = upper and library.cholmod_super_symbolic(upper, None, _address(parent), self._factor, common)
        library.cholmod_free_sparse(byref(upper), common)
        if not done:
            raise MemoryError("CHOLMOD cannot analyse a matrix, probably for lack of memory")
        if not library.cholmod_factorize(byref(matrix), self._factor, common):
            raise MemoryError("CHOLMOD cannot factor a matrix, probably for lack of memory")
        if factor.minor < n:
            raise np.linalg.LinAlgError(f"not positive definite (cholmod: pivot {factor.minor})")

    def last_block(self) -> Float:
        """Return the block U (m, m) of L on `rows` in reverse order, an upper triangle.

        U[m - 1 - i, m - 1 - j] = L[rows[i], rows[j]]; entries below the diagonal are arbitrary.
        """
        factor, place = self._factor.contents, self._place[len(self._place) - self._m :]
        m, k = len(place), factor.nsuper
        first, rows, values = (_array(pointer, k + 1, c_int) for pointer in (factor.super, factor.pi, factor.px))
        row, value = _array(factor.s, factor.ssize, c_int), _array(factor.x, factor.xsize, c_double)
        at = np.full(factor.n, -1)
        at[place] = np.arange(m)[::-1]
        U = np.zeros((m, m), order="F")
        for j in np.unique(np.searchsorted(first, place, "right") - 1).tolist():
            i, columns = at[row[rows[j] : rows[j + 1]]], at[first[j] : first[j + 1]]
            block = value[values[j] : values[j + 1]].reshape(len(columns), len(i))
            if i.min() < 0 or columns.min() < 0:
                block, columns, i = block[columns >= 0][:, i >= 0], columns[columns >= 0], i[i >= 0]
            if all((np.diff(numbers) == -1).all() for numbers in (columns, i)):  # usually one block
                U.T[columns[-1] : columns[0] + 1, i[-1] : i[0] + 1] = block[::-1, ::-1]
            else:
                U.T[np.ix_(columns, i)] = block
        return U

    def forward(self, B: Float) -> Float:
        """Compute L^-1 B for B (n, k), in the order of elimination: the chosen rows of A are last."""
        if not B.shape[1]:
            return B
        permuted = np.empty(B.shape, order="F")
        permuted[self._place] = B[self._order]
        return self._solve(System.L, permuted)[self._place]

    def solve(self, B: Float) -> Float:
        """Compute A^-1 B for B (n,) or (n, k)."""
        return self._solve(System.A, np.asfortranarray(B.reshape(len(B), -1), np.float64)).reshape(B.shape)

    def _solve(self, system: System, B: Float) -> Float:
        """Solve A X = B or L X = B in CHOLMOD's order of rows; B (n, k) is in Fortran order.

        Raises:
            MemoryError: CHOLMOD cannot solve, usually for lack of memory.
        """
        right = _Dense(len(B), B.shape[1], B.size, len(B), _address(B), None, XType.REAL, 0)
        solved = _library().cholmod_solve(system, self._factor, byref(right), self._common)
        if not solved:
            raise MemoryError("CHOLMOD cannot solve, probably for lack of memory")
        try:
            return _array(solved.contents.x, B.size, c_double).reshape(B.shape[::-1]).T.copy(order="F")
        finally:
            _library().cholmod_free_dense(byref(solved), self._common)


def _address(values: Array) -> c_void_p:
    return c_void_p(values.ctypes.data)


def _array(pointer: int, size: int, kind: Any) -> Array:
    """Wrap `size` numbers of the C type `kind` at `pointer` as an array, without a copy."""
    return np.ctypeslib.as_array(ctypes.cast(pointer, POINTER(kind)), (size,))


@cache
def _library() -> ctypes.CDLL:
    """Load the CHOLMOD library that petsc4py is linked with, and turn off its warnings."""
    library = ctypes.CDLL(PETSc.__file__)
    library.cholmod_allocate_factor.restype = POINTER(_Factor)
    library.cholmod_ptranspose.restype = POINTER(_Sparse)
    library.cholmod_solve.restype = POINTER(_Dense)
    try:  # CHOLMOD must not print warnings: this module raises exceptions instead
        library.SuiteSparse_config_printf_func_set(None)
    except AttributeError:  # before SuiteSparse 6, the function for prints is the fifth member of a structure
        with suppress(ValueError):
            (c_void_p * 5).in_dll(library, "SuiteSparse_config")[4] = None
    return library
