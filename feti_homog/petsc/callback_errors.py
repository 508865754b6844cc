"""Exceptions of Python code that PETSc calls: kept until PETSc has returned, then raised."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, TypeVar

from petsc4py import PETSc

from feti_homog.parallel.mpi_errors import all_raise, end_job

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

T = TypeVar("T")


class CallbackErrors:
    """Calls functions within PETSc's callbacks, and keeps the first exception that one raises.

    No exception may pass through PETSc's C code: petsc4py 3.22 crashes. Instead the callback returns what ends PETSc's
    method, such as NaN, and so do all later ones, until `raised` raises the exception.
    """

    def __init__(self, comm: Comm) -> None:
        self._comm = comm
        self._error: BaseException | None = None

    def call(self, function: Callable[[], T], otherwise: T) -> T:
        """Return function(), or `otherwise` if that, or an earlier call, has raised. Collective.

        An error for the user that all ranks raise is kept on all. A rank that raises alone, or meets a defect, ends
        the job: the others, in the middle of `function`, would wait for it.
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
        """At the end of the block, which calls PETSc, raise what was kept."""
        try:
            yield
        except PETSc.Error:
            if self._error is None:
                raise
        error, self._error = self._error, None
        if error is not None:
            raise error
