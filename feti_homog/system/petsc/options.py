"""PETSc's options for one run: the case's defaults below the command line's, none ignored in silence."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial

from petsc4py import PETSc

from feti_homog.errors import CaseError
from feti_homog.system.petsc.c_functions import error_words, option_was_used
from feti_homog.system.petsc.option_table import (
    DIRECT_PREFIXES,
    MUMPS_PREFIXES,
    almost_in_table,
    is_in_table,
    only_prints,
    solver_prefix,
    suggestion,
    unknown_options,
    without_prefix,
)
from feti_homog.system.petsc.option_values import (
    Value,
    faulty_values,
    flag_value,
    in_words,
    is_flag,
    is_own_flag,
    is_viewer,
)

# Options that PETSc looks for only in KSPSolve.
READ_WHEN_SOLVING = {
    f"feti_ksp_{name}" for name in ("converged_reason", "converged_rate", "view", "view_final_residual")
}


@contextmanager
def case_options(options: Mapping[str, Value]) -> Iterator[None]:
    """Insert the options that the command line does not give, and take them out afterwards.

    PETSc has no flags that are true or false, but flags that are there or not: false ones are taken out meanwhile.

    Raises:
        CaseError: before the block, if an option of ours is misspelt or has no such value, or a solver cannot be
            made with what is given.
    """
    database = PETSc.Options()
    on_command_line = given_options()
    options = {name.lower(): value for name, value in options.items()}
    given = {**options, **on_command_line}
    faults = [*unknown_options(given), *without_prefix(given), *faulty_values(given)]
    if faults:
        raise CaseError(*faults)
    kept = {name: flag_value(value) if is_flag(name) else value for name, value in given.items()}
    changed = [name for name in given if kept[name] != on_command_line.get(name) and not is_own_flag(name)]
    try:
        for name in changed:
            _set(database, name, kept[name])
        _refuse_early()
        yield
    finally:
        for name in changed:
            _set(database, name, on_command_line.get(name))


def _set(database: PETSc.Options, name: str, value: Value | None) -> None:
    """Set an option, without a value if that is empty; None takes it out."""
    if value is None:
        database.delValue(name)
    else:
        database.setValue(name, None if value == "" else value)


def given_options() -> dict[str, str]:
    """Return PETSc's options by name, in small letters, with an empty text where there is no value."""
    return {name.lower(): value or "" for name, value in PETSc.Options().getAll().items()}


def choices(prefix: str) -> list[str]:
    """Return the given options under a prefix that choose something: not those that only print."""
    return [name for name in given_options() if name.startswith(prefix) and not only_prints(name)]


def without_iterations() -> str:
    """Return a line on the given options that print iterations, for a run that has none; empty without any."""
    given = [f"-{name}" for name in given_options() if name.startswith("feti_ksp_") and only_prints(name)]
    return f"{', '.join(given)}: the run has no iterations to print" if given else ""


def _refuse_early() -> None:
    """Refuse what solvers of a 1 x 1 matrix cannot be made with, and misspelt names that they do not read.

    Some options are read by larger solvers alone: other names are left to `refuse_unused`.
    """
    given = given_options()
    faults = faults_of_solvers(given)
    if faults:
        raise CaseError(*faults)
    misspelt = [name for name in sorted(given) if almost_in_table(name) and not is_flag(name)]
    _refuse([name for name in misspelt if not option_was_used(name)])


def refuse_unused() -> None:
    """Call when all solvers are set up.

    Options of the table, and of direct solvers that the run does not make, or only when it writes fields, are accepted.

    Raises:
        CaseError: an option with our prefix is no option of any solver.
    """
    _refuse(_unused_names())


def _refuse(names: list[str]) -> None:
    """Raise a CaseError with one fault for each name, if there is any."""
    if names:
        raise CaseError(*(f"-{name}: no solver has such an option; {suggestion(name)}" for name in names))


def _unused_names() -> list[str]:
    """Return the options with our prefix, but for those of the table, that no solver has read or will read."""
    given = [name for name in sorted(PETSc.Options().getAll().keys() - READ_WHEN_SOLVING) if name.startswith("feti_")]
    return [name for name in given if not is_in_table(name) and not option_was_used(name)]


# Options with the prefixes of PETSc's solvers that the program reads itself.
OWN = ("feti_pc_type", "feti_coarse_space", "feti_coarse_threshold")
NO_SUCH_METHOD = "requested KSP type"


def faults_of_solvers(given: Mapping[str, str]) -> list[str]:
    """Faults of the options in the database (names without dash) with which PETSc's solvers cannot be made.

    Each solver is made and applied once: a method may lack what it needs only then.  PETSc marks what they read, and
    prints all that they could with -help.  Options that print are hidden meanwhile.
    """
    trials = {"feti_": _solve_by_krylov_method} | {
        prefix: partial(_solve_directly, prefix) for prefix in DIRECT_PREFIXES
    }
    faults, viewers = [], {name: value for name, value in given.items() if is_viewer(name)}
    with _hidden(viewers):
        for prefix, solve in trials.items():
            own = [name for name in given if _prefix(name) == prefix and name not in (*OWN, *viewers)]
            words = _complaint(solve) if own or "help" in given else ""
            if words:
                own.sort(key=lambda name: not name.endswith("_type"))  # types first: they decide what others mean
                faults.append(f"{' '.join(in_words(name, given[name]) for name in own)}: {words}")
    return faults


def _prefix(name: str) -> str:
    """Return the prefix of the solver that an option is for, that of the Krylov method being feti_.

    Empty for others.
    """
    prefix = solver_prefix(name)
    return "feti_" if prefix in ("feti_ksp_", "feti_pc_") else prefix


def _complaint(solve: Callable[[], None]) -> str:
    """PETSc's complaint about the options of a solver, empty if there is none."""
    try:
        solve()
    except PETSc.Error as error:
        words = error_words(error)
        return "PETSc has no such Krylov method" if NO_SUCH_METHOD in words else words
    return ""


@contextmanager
def _hidden(options: Mapping[str, str]) -> Iterator[None]:
    """Take options out of the database during the block."""
    database = PETSc.Options()
    for name in options:
        database.delValue(name)
    try:
        yield
    finally:
        for name, value in options.items():
            database.setValue(name, value or None)


class _Identity:
    """The 1 x 1 matrix and preconditioner that, as those of the dual problem, are Python's alone."""

    def mult(self, mat: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        x.copy(y)

    def apply(self, pc: PETSc.PC, x: PETSc.Vec, y: PETSc.Vec) -> None:
        x.copy(y)


def _solve_by_krylov_method() -> None:
    A = PETSc.Mat().createPython((1, 1), _Identity(), comm=PETSc.COMM_SELF)
    A.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    A.setUp()
    with _solver(A, "feti_") as ksp:
        ksp.setType(PETSc.KSP.Type.CG)
        ksp.setNormType(PETSc.KSP.NormType.PRECONDITIONED)
        ksp.getPC().setType(PETSc.PC.Type.PYTHON)
        ksp.getPC().setOptionsPrefix("feti_projected_")
        ksp.getPC().setPythonContext(_Identity())


def _solve_directly(prefix: str) -> None:
    A = PETSc.Mat().createAIJ((1, 1), csr=([0, 1], [0], [1.0]), comm=PETSc.COMM_SELF)
    A.setOption(PETSc.Mat.Option.SPD, True)
    with _solver(A, prefix) as ksp:
        ksp.setType(PETSc.KSP.Type.PREONLY)
        ksp.getPC().setType(PETSc.PC.Type.CHOLESKY)
        if prefix in MUMPS_PREFIXES:
            ksp.getPC().setFactorSolverType(PETSc.Mat.SolverType.MUMPS)


@contextmanager
def _solver(A: PETSc.Mat, prefix: str) -> Iterator[PETSc.KSP]:
    """Provide a solver of the 1 x 1 matrix.

    At the end of the block it solves, by the options under `prefix`, and is freed with its matrix.
    """
    ksp, (x, b) = PETSc.KSP().create(PETSc.COMM_SELF), A.createVecs()
    ksp.setOptionsPrefix(prefix)
    ksp.setOperators(A)
    try:
        yield ksp
        ksp.setFromOptions()
        ksp.setUp()
        b.set(1.0)
        ksp.solve(b, x)
    finally:
        for petsc_object in (ksp, A, x, b):
            petsc_object.destroy()
