"""PETSc's options for one run: the case's defaults below the command line's, none ignored in silence."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from petsc4py import PETSc

from feti_homog.common import petsc_ctypes
from feti_homog.common.petsc_option_table import (
    DIRECT_PREFIXES,
    MUMPS_PREFIXES,
    is_in_table,
    suggestion,
    unknown_options,
)
from feti_homog.errors import CaseError

# Options that PETSc looks for only in KSPSolve.
READ_WHEN_SOLVING = {
    f"feti_ksp_{name}" for name in ("converged_reason", "converged_rate", "view", "view_final_residual")
}


@contextmanager
def case_options(options: Mapping[str, str | int | float | bool]) -> Iterator[None]:
    """Insert the options that the command line does not give, and remove them afterwards.

    Raises:
        CaseError: an option of ours is misspelt, or the tolerance is none.
    """
    database = PETSc.Options()
    given = {**options, **database.getAll()}
    faults = [*unknown_options(given), *_faulty_tolerance(given)]
    if faults:
        raise CaseError(*faults)
    own = {name: value for name, value in options.items() if not database.hasName(name)}
    for name, value in own.items():
        database.setValue(name, value)
    try:
        yield
    finally:
        for name in own:
            database.delValue(name)


def _faulty_tolerance(options: Mapping[str, str | int | float | bool]) -> list[str]:
    """A fault if the relative tolerance is not between 0 and 1: with 1 or more, nothing is solved."""
    if (name := "feti_ksp_rtol") not in options:
        return []
    try:
        holds = 0.0 < float(options[name]) < 1.0
    except ValueError:
        holds = False
    return [] if holds else [f"-{name} {options[name]}: expected a number above 0 and below 1"]


def refuse_unused() -> None:
    """Call when all solvers are set up.  Options of the table, and of solvers that the run does not make, or only when
    it writes fields, are accepted.

    Raises:
        CaseError: an option with our prefix is no option of any solver, or a solver cannot be made with it.
    """
    unused = _unused_names()
    for prefix in DIRECT_PREFIXES:
        if any(name.startswith(prefix) for name in unused):
            _let_solver_read(prefix)
    faults = [f"-{name}: no solver has such an option; {suggestion(name)}" for name in _unused_names()]
    if faults:
        raise CaseError(*faults)


def _unused_names() -> list[str]:
    """The options with our prefix, but for those of the table, that no solver has read or will read."""
    given = [name for name in sorted(PETSc.Options().getAll().keys() - READ_WHEN_SOLVING) if name.startswith("feti_")]
    return [name for name in given if not is_in_table(name) and not petsc_ctypes.option_was_used(name)]


def _let_solver_read(prefix: str) -> None:
    """Set up a direct solver of a 1 x 1 matrix with the options under the prefix, so that PETSc marks what it reads.

    Raises:
        CaseError: it cannot be made.
    """
    A = PETSc.Mat().createAIJ((1, 1), csr=([0, 1], [0], [1.0]), comm=PETSc.COMM_SELF)
    A.setOption(PETSc.Mat.Option.SPD, True)
    ksp = PETSc.KSP().create(PETSc.COMM_SELF)
    ksp.setOptionsPrefix(prefix)
    ksp.setOperators(A)
    ksp.setType(PETSc.KSP.Type.PREONLY)
    ksp.getPC().setType(PETSc.PC.Type.CHOLESKY)
    if prefix in MUMPS_PREFIXES:
        ksp.getPC().setFactorSolverType(PETSc.Mat.SolverType.MUMPS)
    try:
        ksp.setFromOptions()
        ksp.setUp()
    except PETSc.Error as error:
        raise CaseError(f"-{prefix}...: {str(error).splitlines()[-1]}") from error
    finally:
        ksp.destroy()
        A.destroy()
