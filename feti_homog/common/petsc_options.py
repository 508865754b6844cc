"""PETSc's options for one run: the case's defaults below the command line's, none ignored in silence."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from petsc4py import PETSc

from feti_homog.common import petsc_ctypes
from feti_homog.common.petsc_option_table import (
    DIRECT_PREFIXES,
    MUMPS_PREFIXES,
    almost_in_table,
    is_in_table,
    solver_prefix,
    suggestion,
    unknown_options,
)
from feti_homog.common.petsc_option_values import RULES, Value, faulty_values
from feti_homog.errors import CaseError

KRYLOV_PREFIXES = ("feti_ksp_", "feti_pc_")

# Options that PETSc looks for only in KSPSolve.
READ_WHEN_SOLVING = {
    f"feti_ksp_{name}" for name in ("converged_reason", "converged_rate", "view", "view_final_residual")
}


@contextmanager
def case_options(options: Mapping[str, Value]) -> Iterator[None]:
    """Insert the options that the command line does not give, and remove them afterwards.

    Raises:
        CaseError: before the block, if an option of ours is misspelt or has no such value, or a solver cannot be
            made with what is given.
    """
    database = PETSc.Options()
    given = {**options, **_given()}
    faults = [*unknown_options(given), *faulty_values(given)]
    if faults:
        raise CaseError(*faults)
    own = {name: value for name, value in options.items() if not database.hasName(name)}
    for name, value in own.items():
        database.setValue(name, value)
    try:
        _refuse_early()
        yield
    finally:
        for name in own:
            database.delValue(name)


def _given() -> dict[str, str]:
    """PETSc's options by name, with an empty text where there is no value."""
    return {name: value or "" for name, value in PETSc.Options().getAll().items()}


def _refuse_early() -> None:
    """Refuse what solvers of a 1 x 1 matrix cannot be made with, and misspelt names that they do not read.

    Some options are read by larger solvers alone: other names are left to `refuse_unused`.
    """
    given = _given()
    misspelt = list(filter(almost_in_table, given))
    if "feti_ksp_type" in given or any(name.startswith(KRYLOV_PREFIXES) for name in misspelt):
        _let_krylov_method_read(given)
    for prefix in DIRECT_PREFIXES:
        own = [name for name in given if solver_prefix(name) == prefix and name not in RULES]
        if own:
            _let_direct_solver_read(prefix, " ".join(f"-{name} {given[name]}".strip() for name in own))
    _refuse([name for name in _unused_names() if name in misspelt])


def refuse_unused() -> None:
    """Call when all solvers are set up.  Options of the table, and of direct solvers that the run does not make, or
    only when it writes fields, are accepted.

    Raises:
        CaseError: an option with our prefix is no option of any solver.
    """
    _refuse(_unused_names())


def _refuse(names: list[str]) -> None:
    """Raise a CaseError with one fault for each name, if there is any."""
    if names:
        raise CaseError(*(f"-{name}: no solver has such an option; {suggestion(name)}" for name in names))


def _unused_names() -> list[str]:
    """The options with our prefix, but for those of the table, that no solver has read or will read."""
    given = [name for name in sorted(PETSc.Options().getAll().keys() - READ_WHEN_SOLVING) if name.startswith("feti_")]
    return [name for name in given if not is_in_table(name) and not petsc_ctypes.option_was_used(name)]


def _let_krylov_method_read(given: Mapping[str, str]) -> None:
    """Make a Krylov method for a 1 x 1 matrix, so that PETSc marks what it reads.

    Raises:
        CaseError: PETSc has no such method.
    """
    with _solver("feti_", PETSc.KSP.Type.CG) as ksp:
        ksp.getPC().setOptionsPrefix("feti_projected_")
        try:
            ksp.setType(given.get("feti_ksp_type", PETSc.KSP.Type.CG))
        except PETSc.Error as error:
            raise CaseError(f"-feti_ksp_type {given['feti_ksp_type']}: PETSc has no such Krylov method") from error
        if any(name.startswith(KRYLOV_PREFIXES) and not is_in_table(name) for name in given):
            ksp.setFromOptions()


def _let_direct_solver_read(prefix: str, words: str) -> None:
    """Set up a direct solver of a 1 x 1 matrix with the options under the prefix, so that PETSc marks what it reads.

    Raises:
        CaseError: it cannot be made with these options, `words` as the user wrote them.
    """
    with _solver(prefix, PETSc.KSP.Type.PREONLY) as ksp:
        ksp.getPC().setType(PETSc.PC.Type.CHOLESKY)
        if prefix in MUMPS_PREFIXES:
            ksp.getPC().setFactorSolverType(PETSc.Mat.SolverType.MUMPS)
        try:
            ksp.setFromOptions()
            ksp.setUp()
        except PETSc.Error as error:
            raise CaseError(f"{words}: {str(error).splitlines()[-1].split('] ', 1)[-1]}") from error


@contextmanager
def _solver(prefix: str, kind: str) -> Iterator[PETSc.KSP]:
    """A solver of a 1 x 1 matrix on this rank, freed at the end of the block."""
    A = PETSc.Mat().createAIJ((1, 1), csr=([0, 1], [0], [1.0]), comm=PETSc.COMM_SELF)
    A.setOption(PETSc.Mat.Option.SPD, True)
    ksp = PETSc.KSP().create(PETSc.COMM_SELF)
    ksp.setOptionsPrefix(prefix)
    ksp.setOperators(A)
    ksp.setType(kind)
    try:
        yield ksp
    finally:
        ksp.destroy()
        A.destroy()
