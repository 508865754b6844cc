"""PETSc's options for one run: the case's defaults below the command line's, none ignored in silence."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from petsc4py import PETSc

from feti_homog.errors import CaseError
from feti_homog.petsc import c_functions, option_trials
from feti_homog.petsc.option_table import almost_in_table, is_in_table, suggestion, unknown_options, without_prefix
from feti_homog.petsc.option_values import Value, faulty_values, flag_value, is_flag, is_own_flag

# Options that PETSc looks for only in KSPSolve.
READ_WHEN_SOLVING = {
    f"feti_ksp_{name}" for name in ("converged_reason", "converged_rate", "view", "view_final_residual")
}


@contextmanager
def case_options(options: Mapping[str, Value]) -> Iterator[None]:
    """Insert the options that the command line does not give, and take them out afterwards.

    PETSc knows no flags that are true or false, but such as are there or not: false ones are taken out meanwhile.

    Raises:
        CaseError: before the block, if an option of ours is misspelt or has no such value, or a solver cannot be
            made with what is given.
    """
    database = PETSc.Options()
    on_command_line = _given()
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


def _given() -> dict[str, str]:
    """PETSc's options by name, in small letters, with an empty text where there is no value."""
    return {name.lower(): value or "" for name, value in PETSc.Options().getAll().items()}


def _refuse_early() -> None:
    """Refuse what solvers of a 1 x 1 matrix cannot be made with, and misspelt names that they do not read.

    Some options are read by larger solvers alone: other names are left to `refuse_unused`.
    """
    given = _given()
    faults, read = option_trials.examine(given)
    if faults:
        raise CaseError(*faults)
    for name in read:
        PETSc.Options().hasName(name)  # so that PETSc marks it as read
    _refuse([name for name in sorted(given) if almost_in_table(name) and not is_flag(name) and name not in read])


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
    return [name for name in given if not is_in_table(name) and not c_functions.option_was_used(name)]
