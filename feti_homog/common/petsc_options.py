"""PETSc's options for one run: the case's defaults below the command line's, none ignored in silence."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from petsc4py import PETSc

from feti_homog.common import petsc_ctypes
from feti_homog.common.petsc_option_table import unknown_options
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
    """Call when all solvers are set up.

    Raises:
        CaseError: an option with our prefix was read by no solver.
    """
    given = [name for name in sorted(PETSc.Options().getAll().keys() - READ_WHEN_SOLVING) if name.startswith("feti_")]
    unused = [name for name in given if not petsc_ctypes.option_was_used(name)]
    if unused:
        raise CaseError(*(f"-{name}: no solver of this run has such an option" for name in unused))
