"""List the option names of the solver and of PETSc, and find misspelt names."""

import difflib
import re
from collections.abc import Iterable
from dataclasses import dataclass


@dataclass(frozen=True)
class Option:
    """An option of the solver: name without dash, values, default, and one line of help."""

    name: str
    value: str
    default: str
    help: str


def _direct_solver(prefix: str, matrix: str, library: str = "cholmod") -> tuple[Option, Option]:
    """Return the options of the direct solver with a prefix; `matrix` describes its matrix in their help texts."""
    return (
        Option(f"{prefix}pc_type", "cholesky|lu", "cholesky", f"factorization of {matrix}"),
        Option(f"{prefix}pc_factor_mat_solver_type", "cholmod|mumps|...", library, f"library of {matrix}"),
    )


def _coarse_solver(prefix: str, matrix: str) -> tuple[Option, ...]:
    """Return the options of the coarse solver with a prefix; `matrix` describes its matrix in their help texts."""
    library = f"library of {matrix}; on one rank cholmod by default"
    return (
        Option(f"{prefix}ksp_type", "preonly|cg|...", "preonly", f"one factor of {matrix}, or an iterative method"),
        Option(f"{prefix}ksp_rtol", "<real>", "1e-10", "relative tolerance of the iterative method"),
        Option(f"{prefix}pc_type", "cholesky|gamg|...", "cholesky", "the factor, or a preconditioner of the method"),
        Option(f"{prefix}pc_factor_mat_solver_type", "cholmod|mumps|...", "mumps", library),
    )


PC_TYPES = "auto|none|lumped|dirichlet|influence"
COLUMNS_HELP = "changed rows after which a new reference cell is factored; by default none below 2501 rows"
OPTIONS = (
    Option("feti_ksp_type", "cg|fcg|gmres|...", "cg", "Krylov method on the dual operator; only cg, fcg test jumps"),
    Option("feti_ksp_rtol", "<real>", "1e-8", "relative tolerance of the dual and the primal residuals"),
    Option("feti_ksp_atol", "<real>", "0", "absolute tolerance of the dual residual"),
    Option("feti_ksp_max_it", "<integer>", "2000", "largest number of iterations per load case"),
    Option("feti_ksp_monitor", "", "", "print the residual at every iteration"),
    Option("feti_ksp_converged_reason", "", "", "print why each solve ended"),
    Option("feti_ksp_view", "", "", "print the solver's settings"),
    Option("feti_ksp_view_singularvalues", "", "", "print the estimated condition number"),
    Option("feti_pc_type", PC_TYPES, "auto", "dual preconditioner; influence: exact; adaptive space: only dirichlet"),
    Option("feti_dual_operator", "auto|implicit|explicit", "auto", "triangular solves (natural coarse space) or dense"),
    Option("feti_coarse_space", "auto|natural|adaptive", "auto", "rigid-body motions only, or soft modes too"),
    Option("feti_coarse_threshold", "<real>", "0.35", "softer modes join the coarse space; fewer iterations if larger"),
    Option("feti_influence_columns", "<integer>", "1000", COLUMNS_HELP),
    Option("feti_view", "", "", "print subdomains, coarse space and estimated condition numbers"),
    Option("feti_schur_mat_mumps_icntl_7", "0|2|3|4|5|6|7", "7", "MUMPS' ordering in the partial factorizations"),
    Option("feti_schur_mat_mumps_icntl_14", "<integer>", "20", "MUMPS' extra workspace for them, in per cent"),
    Option("feti_sub_ksp_type", "preonly|...", "preonly", "solves with implicit subdomains"),
    *_direct_solver("feti_sub_", "implicit subdomains"),
    *_direct_solver("feti_interior_", "interiors, of implicit subdomains and for fields"),
    *_coarse_solver("feti_natural_", "the rigid-body coarse problem"),
    *_coarse_solver("feti_coarse_", "the adaptive coarse problem"),
    *_direct_solver("feti_bonded_", "the cell with all bonds intact, for influence columns"),
)
"""The options that every run accepts, even if the run does not make the solver that reads an option."""
TABLE = {option.name: option for option in OPTIONS}

DIRECT_PREFIXES = tuple(f"feti_{name}_" for name in ("sub", "interior", "schur", "natural", "coarse", "bonded"))
"""Prefixes of PETSc's direct solvers."""

MUMPS_PREFIXES = ("feti_schur_",)
"""Prefixes of direct solvers whose default library is MUMPS."""

PREFIXES = ("feti_ksp_", "feti_pc_", *DIRECT_PREFIXES)
"""Prefixes of all PETSc solvers; the rest of a name is an option of PETSc."""

# Options that PETSc reads when it starts, logs and ends.
PETSC_NAMES = (
    "help", "version", "info", "info_exclude", "tmp", "shared_tmp", "log_view", "log_view_memory",
    "log_view_gpu_time", "log_all", "log_trace", "get_total_flops", "malloc", "malloc_debug", "malloc_dump",
    "malloc_view", "malloc_test", "memory_view", "objects_dump", "checkstack", "options_file", "options_left",
    "options_view", "options_monitor", "options_monitor_cancel", "options_suppress_deprecated_warnings",
    "skip_petscrc", "on_error_abort", "on_error_mpiabort", "error_output_stdout", "error_output_none",
    "no_signal_handler", "fp_trap", "check_pointer_intensity", "mpidump",
)  # fmt: skip
# Beginnings of options with which PETSc waits for a person, runs other code, or reads unchecked files.
NOT_IN_BATCH = re.compile("history|citations|python|options_.*yaml|start_|stop_|debug|dll|on_error_(att|em)")
# Beginnings of options that would replace what the Krylov method gets from the program.
OWN_CHOICES = re.compile("feti_ksp_(convergence_test|check_norm|constant_null_space|diagonal_scale|guess|fischer|init)")
# Beginnings of further options, which differ between releases of PETSc.
PETSC_BEGINNINGS = ("log_", "malloc_", "device_", "cuda_", "hip_", "sf_", "viewer_", "use_gpu_aware_mpi")

# Parts of the names of options that print; options in LEVEL have a number, the level of printing.
SHOWING = re.compile(r"(^|_)(view|monitor|converged_reason|converged_rate)(_|$)|_(compute|plot)_(singular|eigen)values")
LEVEL = re.compile(r"_(print|printstat|statprint)$|_mumps_icntl_[1-4]$")

CLOSE = 0.9
"""Least similarity (by difflib; 1 for equal names) of a misspelt name: one or two letters differ."""


def unknown_options(names: Iterable[str]) -> list[str]:
    """Return one fault for every name (without dash) that is unknown, misspelt or unfit for batch runs."""
    faults = []
    for name in names:
        hint = ""
        if OWN_CHOICES.match(name):
            hint = "the program itself chooses the start, the scaling and the end of the iteration"
        elif name.startswith("feti_"):
            if name not in TABLE and not solver_prefix(name):
                hint = f"unknown option; {suggestion(name)}"
        elif f"feti_{name}" in TABLE:
            hint = f"not an option of this program; did you mean -feti_{name}?"
        elif NOT_IN_BATCH.match(name):
            hint = "no option of a program that runs in batch"
        elif name not in PETSC_NAMES:
            nearest = difflib.get_close_matches(name, PETSC_NAMES, 1, 7 / 8)
            if nearest:
                hint = f"unknown option; did you mean -{nearest[0]}?"
            elif not name.startswith(PETSC_BEGINNINGS):
                hint = "unknown option; solvers of this program have options that begin with -feti_"
        if hint:
            faults.append(f"-{name}: {hint}")
    return faults


def only_prints(name: str) -> bool:
    """Return whether an option (name without dash) prints and changes no solver."""
    return any(kind.search(name) for kind in (SHOWING, LEVEL))


def almost_in_table(name: str) -> bool:
    """Return whether an unknown option (name without dash) closely resembles a name in TABLE with its solver prefix."""
    prefix = solver_prefix(name)
    table = [option for option in TABLE if solver_prefix(option) == prefix]
    return bool(prefix and name not in TABLE and difflib.get_close_matches(name, table, 1, CLOSE))


def suggestion(name: str) -> str:
    """Return a hint for an unknown option: the closest option in the table, or all prefixes."""
    nearest = difflib.get_close_matches(name, TABLE, n=1)
    return f"did you mean -{nearest[0]}?" if nearest else f"prefixes: -{', -'.join(PREFIXES)}"


def solver_prefix(name: str) -> str:
    """Return the longest prefix in PREFIXES with which a longer name begins, else an empty string."""
    return max((prefix for prefix in PREFIXES if name.startswith(prefix) and name != prefix), key=len, default="")


def help_text() -> str:
    """Return the help on the solver options: a heading, then one line per option."""
    usages = [f"-{option.name} {option.value}".strip() for option in OPTIONS]
    width = max(map(len, usages))
    lines = [
        f"  {usage:{width}}  {option.help}" + (f" (default {option.default})" if option.default else "")
        for usage, option in zip(usages, OPTIONS, strict=True)
    ]
    return "\n".join(["PETSc options of the solver, with a single dash; printing options change no result:", *lines])
