"""Count the communicating calls that Python makes by mpi4py; refuse communication in guarded sections."""

import contextlib
import sys
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from types import CodeType, FrameType, MethodType
from typing import Any

import h5py
from mpi4py import MPI
from petsc4py import PETSc

COLLECTIVES = frozenset(
    {"Barrier", "barrier", "Bcast", "bcast", "Allreduce", "allreduce", "Reduce", "reduce", "Allgather", "allgather"}
    | {"Allgatherv", "Gather", "gather", "Gatherv", "Scatter", "scatter", "Scatterv", "Alltoall", "alltoall"}
    | {"Alltoallv", "Reduce_scatter", "Exscan", "exscan", "Scan", "scan"}
)
# Methods that look at an object, of mpi4py and PETSc, by how their names begin; and `destroy`, which Python's garbage
# collection may call anywhere.
LOCAL = ("Get_", "Is_", "py2f", "tompi4py", "get", "is", "__", "destroy")


class CommunicationError(AssertionError):
    """A guarded section communicates."""


@contextmanager
def collective_calls() -> Iterator[Counter[str]]:
    """Provide the calls of this rank in the block, by name; calls inside PETSc and MUMPS do not count.

    The block gets slower, so its times mean nothing.
    """
    calls: Counter[str] = Counter()

    def note(frame: FrameType, event: str, function: Any) -> None:
        if event == "c_call" and function.__name__ in COLLECTIVES and isinstance(function.__self__, MPI.Comm):
            calls[function.__name__] += 1

    with _profiled(note):
        yield calls


@contextmanager
def no_communication() -> Iterator[None]:
    """Provide a block in which communication raises CommunicationError.

    mpi4py, and PETSc objects and HDF5 files of several ranks, raise it before they communicate; creating such a PETSc
    object raises it afterwards.
    """

    def refuse(frame: FrameType, event: str, function: Any) -> None:
        if event == "call":
            name = frame.f_code.co_name if _is_shared_file(frame) else ""
        else:
            name = function.__name__ if event in ("c_call", "c_return") and _is_of_ranks(function) else ""
        if name:
            raise CommunicationError(f"{name} is called in a guarded section, from {frame.f_code.co_qualname}")

    with _profiled(refuse):
        yield


@contextmanager
def _profiled(note: Any) -> Iterator[None]:
    before = sys.getprofile()
    sys.setprofile(note)
    try:
        with _monitored(note):
            yield
    finally:
        sys.setprofile(before)


@contextmanager
def _monitored(note: Any) -> Iterator[None]:
    """Note calls of methods that Cython 3 compiled, which profiles leave out since Python 3.12."""
    if sys.version_info < (3, 12):
        yield
        return
    tool, event = 3, sys.monitoring.events.CALL  # a tool without a given use

    def called(code: CodeType, offset: int, function: Any, first: Any) -> None:
        if type(function).__name__ == "cython_function_or_method":
            note(sys._getframe(1), "c_call", MethodType(function, first))

    if sys.monitoring.get_tool(tool) is None:
        sys.monitoring.use_tool_id(tool, __name__)
    before = sys.monitoring.register_callback(tool, event, called)
    sys.monitoring.set_events(tool, event)
    try:
        yield
    finally:
        sys.monitoring.register_callback(tool, event, before)
        sys.monitoring.set_events(tool, event if before else 0)


def _is_of_ranks(function: Any) -> bool:
    """Return True if a method changes an object of mpi4py or PETSc that several ranks have."""
    thing = getattr(function, "__self__", None)
    if not isinstance(thing, MPI.Comm | PETSc.Object) or function.__name__.startswith(LOCAL):
        return False
    comm = thing if isinstance(thing, MPI.Comm) else thing.comm if thing.handle else MPI.COMM_NULL
    return comm != MPI.COMM_NULL and bool(comm.size > 1)


def _is_shared_file(frame: FrameType) -> bool:
    """Return True if a starting h5py function opens or uses a file of several ranks."""
    if not frame.f_globals.get("__name__", "").startswith("h5py."):
        return False
    values = frame.f_locals
    if frame.f_code.co_name == "__init__":
        return values.get("driver") == "mpio" and bool(values["kwds"].get("comm", MPI.COMM_SELF).size > 1)
    # These are raised where it is not open, or the object is none of a file.
    with contextlib.suppress(AttributeError, KeyError, TypeError, ValueError, RuntimeError):
        plist = h5py.h5i.get_file_id(values["self"].id).get_access_plist()
        return bool(plist.get_driver() == h5py.h5fd.MPIO and plist.get_fapl_mpio()[0].size > 1)
    return False
