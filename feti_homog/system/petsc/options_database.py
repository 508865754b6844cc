"""Set PETSc's options for one run: the command line overrides the case, and no option is ignored silently."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from petsc4py import PETSc

from feti_homog.errors import CaseError
from feti_homog.system.petsc import option_table as table
from feti_homog.system.petsc import option_values as values
from feti_homog.system.petsc.c_functions import error_words, option_was_used

# Options that PETSc reads only in KSPSolve.
READ_WHEN_SOLVING = {f"feti_ksp_{key}" for key in ("converged_reason", "converged_rate", "view", "view_final_residual")}


@contextmanager
def case_options(options: Mapping[str, values.Value]) -> Iterator[None]:
    """Context manager: set the options of a case during a block; options of the command line take precedence.

    False flags are removed for the block: PETSc may take a flag as set, whatever its value.

    Raises:
        CaseError: before the block, if an option of this program is misspelt or has an invalid value, or if a solver
            cannot be made with the options.
    """
    database = PETSc.Options()
    on_command_line, options = given_options(), {name.lower(): value for name, value in options.items()}
    options_of_run = {**options, **on_command_line}
    if faults := [*table.unknown_options(options), *values.faulty_values(options_of_run)]:
        raise CaseError(*faults)
    texts = {name: values.flag_value(text) if values.is_flag(name) else text for name, text in options_of_run.items()}
    settable = [name for name in options_of_run if not values.is_own_flag(name)]
    changed = [name for name in settable if texts[name] != on_command_line.get(name)]
    try:
        for name in changed:
            _set(database, name, texts[name])
        in_database = given_options()
        if faults := faults_of_solvers(in_database):
            raise CaseError(*faults)
        # Only larger solvers read some options: names unlike the names in the table wait for `refuse_unused`.
        _refuse_unread([name for name in in_database if table.almost_in_table(name) and not values.is_flag(name)])
        yield
    finally:
        for name in changed:
            _set(database, name, on_command_line.get(name))


def _set(database: PETSc.Options, name: str, value: values.Value | None) -> None:
    """Set an option, without a value for an empty string; delete the option for None."""
    if value is None:
        database.delValue(name)
    else:
        database.setValue(name, None if value == "" else value)


def given_options() -> dict[str, str]:
    """Return PETSc's options by lower-case name; an option without a value has an empty string."""
    return {name.lower(): value or "" for name, value in PETSc.Options().getAll().items()}


def choices(prefix: str) -> dict[str, str]:
    """Return the options with a prefix, except options that only print."""
    return {k: value for k, value in given_options().items() if k.startswith(prefix) and not table.only_prints(k)}


def without_iterations() -> str:
    """Return a remark on the set options that print iterations, for a run that has none; "" without such options."""
    printing = [f"-{name}" for name in given_options() if name.startswith("feti_ksp_") and table.only_prints(name)]
    return f"{', '.join(printing)}: the run has no iterations to print" if printing else ""


def refuse_unused() -> None:
    """Refuse `feti_` options that no solver has read; call this after the set-up of all solvers.

    Options in the table are accepted, because a run may make their solvers later or not at all.

    Raises:
        CaseError: no solver has such an option.
    """
    names = PETSc.Options().getAll().keys() - READ_WHEN_SOLVING
    _refuse_unread([name for name in names if name.startswith("feti_") and name not in table.TABLE])


def _refuse_unread(names: list[str]) -> None:
    """Raise CaseError, with one fault for every name that no solver has read."""
    if unread := [name for name in sorted(names) if not option_was_used(name)]:
        raise CaseError(*(f"-{name}: no solver has such an option; {table.suggestion(name)}" for name in unread))


# Options of this program whose names begin like the options of PETSc's solvers.
OWN = ("feti_pc_type", "feti_coarse_space", "feti_coarse_threshold")
SOLVERS = {"feti_": ("feti_ksp_", "feti_pc_")} | {prefix: (prefix,) for prefix in table.DIRECT_PREFIXES}
"""Prefixes of the options that a solver reads, by the prefix of the solver."""
NO_SUCH_METHOD = "requested KSP type"
EXACT = ("cholesky", "lu", "qr", "svd", "redundant")
"""PETSc's preconditioners that solve in one application, as PETSc's method `preonly` needs."""


class _Identity:
    """The identity as a 1 x 1 shell matrix and shell preconditioner, in place of the dual problem."""

    def mult(self, shell: PETSc.Object, x: PETSc.Vec, y: PETSc.Vec) -> None:
        x.copy(y)

    apply = mult


def faults_of_solvers(options: Mapping[str, str]) -> list[str]:
    """Return the faults of options with which PETSc's solvers cannot be made.

    `options` has the names without dash and the values in the database.  Every solver with options (with -help, every
    solver) is made for a 1 x 1 matrix and applied once, because some methods fail only then.  PETSc marks the options
    that it reads, and prints all readable options with -help.  Options that print are removed meanwhile.
    """
    faults = []
    viewers = [name for name in options if values.is_viewer(name)]
    database, comm = PETSc.Options(), PETSc.COMM_SELF
    try:
        for name in viewers:
            database.delValue(name)
        for prefix, prefixes in SOLVERS.items():
            names = [name for name in options if table.solver_prefix(name) in prefixes and name not in (*OWN, *viewers)]
            if not names and "help" not in options:
                continue
            is_krylov, A = prefix == "feti_", PETSc.Mat()
            if is_krylov:
                A.createPython((1, 1), _Identity(), comm=comm)
            else:
                A.createAIJ((1, 1), csr=([0, 1], [0], [1.0]), comm=comm)
            A.setOption(PETSc.Mat.Option.SYMMETRIC if is_krylov else PETSc.Mat.Option.SPD, True)
            A.setUp()
            ksp, (x, b) = PETSc.KSP().create(comm), A.createVecs()
            ksp.setOptionsPrefix(prefix)
            ksp.setOperators(A)
            try:
                ksp.setType(PETSc.KSP.Type.CG if is_krylov else PETSc.KSP.Type.PREONLY)
                pc = ksp.getPC()
                pc.setType(PETSc.PC.Type.PYTHON if is_krylov else PETSc.PC.Type.CHOLESKY)
                if is_krylov:
                    ksp.setNormType(PETSc.KSP.NormType.PRECONDITIONED)
                    pc.setOptionsPrefix("feti_projected_")
                    pc.setPythonContext(_Identity())
                if prefix in table.MUMPS_PREFIXES:
                    pc.setFactorSolverType(PETSc.Mat.SolverType.MUMPS)
                ksp.setFromOptions()
                if not is_krylov and ksp.getType() == PETSc.KSP.Type.PREONLY and pc.getType() not in EXACT:
                    fault = f"-{prefix}pc_type {pc.getType()}: -{prefix}ksp_type preonly needs a factorization"
                    faults.append(f"{fault}; add -{prefix}ksp_type cg")
                    continue
                ksp.setErrorIfNotConverged(not is_krylov)  # MUMPS fails silently otherwise
                ksp.setUp()
                b.set(1.0)
                ksp.solve(b, x)
            except PETSc.Error as error:
                fault = error_words(error)
                names.sort(key=lambda name: not name.endswith("_type"))  # other options depend on the types
                words = " ".join(values.in_words(name, options[name]) for name in names)
                faults.append(f"{words}: {'PETSc has no such Krylov method' if NO_SUCH_METHOD in fault else fault}")
            finally:
                for petsc_object in (ksp, A, x, b):
                    petsc_object.destroy()
    finally:
        for name in viewers:
            _set(database, name, options[name])
    return faults
