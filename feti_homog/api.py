"""Run cases, sweeps, fits and other MPI programs from Python; the first call starts PETSc."""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import os
import sys
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from feti_homog.case import Case, toml_files
from feti_homog.errors import CaseError, ExitCode, FetiHomogError, LibraryError
from feti_homog.system.parallel import mpi_errors
from feti_homog.system.petsc import libraries, option_table, option_values
from feti_homog.system.runtime import process, standard_streams
from feti_homog.typing import Intracomm

if TYPE_CHECKING:
    from feti_homog.analysis import result
    from feti_homog.studies import sweep_table

RUNNING = threading.RLock()  # PETSc allows one thread at a time


def run(
    case: Case,
    comm: Intracomm | None = None,
    *,
    out: str | Path | None = None,
    fields: bool = False,
    resume: bool = False,
    quiet: bool = True,
) -> result.Result:
    """Run a case on the ranks of `comm`, by default all ranks, and return its result on each of them.

    Collective over `comm`; other ranks need not take part.  Unless PETSc already runs, it starts with the options in
    PETSC_OPTIONS; the options in the section `petsc` hold during this run.

    Args:
        out: a folder for the files that `feti-homog run` writes; by default the run writes no files.
        fields: whether `result.fields` holds mesh, interface and states in memory, distributed over the ranks.
        resume: with `out`, continue an interrupted path in the same folder, or read its finished result.
        quiet: print nothing; otherwise print as the command line does.

    Raises:
        TypeError: `case` is not a Case, or `comm` is not an intracommunicator.
        CaseError, MeshError: the case cannot be run, ranks of `comm` have different cases or arguments, PETSC_OPTIONS
            is faulty, or `out` cannot be used.
        ConvergenceError: a solve did not converge or a check failed; its `result`, and `out`, hold the computed part.
        LibraryError: mpi4py, petsc4py or h5py is missing or does not fit.
        FetiHomogError: a file cannot be written, MPI has ended, or another thread is in a call of this module.
    """
    with _started(comm, case, out, fields, resume) as comm:
        if not isinstance(case, Case):
            is_for = "Case.load reads a file, Case.parse a document"
            raise TypeError(f"run takes a Case, not {type(case).__name__}: {is_for}")
        from feti_homog.analysis import runner

        if out is None:
            return runner.compute(case, comm, fields, quiet)
        return runner.run(case, folder(out), standard_streams.Progress(comm, quiet), resume, fields)


def run_sweep(
    cases: str | Path | Mapping[str, Any],
    out: str | Path,
    comm: Intracomm | None = None,
    *,
    ranks_per_case: int | None = None,
    retry: bool = False,
    quiet: bool = True,
) -> sweep_table.SweepTable:
    """Run the cases of a sweep, given as a file or document, and return their table on every rank.  Collective.

    The same call resumes an interrupted sweep in `out`.  `comm` is as in `run`.

    Args:
        ranks_per_case: ranks of a case (default: all); groups of this size work concurrently.
        retry: compute failed cases again.
        quiet: do not print a line for each case.

    Raises:
        CaseError: the cases are faulty, `out` cannot be used, or `ranks_per_case` does not divide the ranks.
        ConvergenceError: cases failed; `collect_sweep` makes the table of the finished cases.
        FetiHomogError, LibraryError, TypeError: as in `run`.
    """
    with _started(comm, cases, out, ranks_per_case, retry) as comm:
        from feti_homog.studies import case_runs, collect, sweep_cases

        given = (sweep_cases.expand, cases, Path()) if isinstance(cases, Mapping) else (sweep_cases.load, cases)
        sweep = mpi_errors.on_root(comm, *given)
        case_runs.run_all(sweep, folder(out), comm, ranks_per_case, retry, quiet)
        return mpi_errors.on_root(comm, collect.read, Path(out))


def collect_sweep(out: str | Path, comm: Intracomm | None = None, *, pictures: bool = True) -> list[str]:
    """Write cases.csv, statistics.csv and, with `pictures`, a picture of a sweep; return lines to print.  Collective.

    The sweep may still be running.  Raises CaseError if `out` is not a sweep folder, FetiHomogError if a write fails.
    """
    with _started(comm, out, pictures) as comm:
        from feti_homog.studies import collect

        return mpi_errors.on_root(comm, collect.collect, Path(out), pictures)


def run_fit(
    fit: str | Path | Mapping[str, Any],
    out: str | Path,
    comm: Intracomm | None = None,
    *,
    ranks_per_case: int | None = None,
    retry: bool = False,
    quiet: bool = True,
) -> dict[str, Any]:
    """Fit the unknowns in a file or document to measured values.  Collective.

    Returns the content of fit.json on every rank.  Arguments, other errors and resumption are as for `run_sweep`.

    Raises:
        CaseError: the fit is faulty, or `out` cannot be used.
        ConvergenceError: a case failed, the data do not determine the unknowns, or the model does not fit the data.
    """
    with _started(comm, fit, out, ranks_per_case, retry) as comm:
        from feti_homog.studies import fit_file

        given = (fit_file.parse, fit, Path()) if isinstance(fit, Mapping) else (fit_file.load, Path(fit))
        content: dict[str, Any] = mpi_errors.on_root(comm, *given).run(folder(out), comm, ranks_per_case, retry, quiet)
        return content


def launch(
    main: Callable[[argparse.Namespace, Intracomm], object],
    parser: argparse.ArgumentParser,
    argv: Sequence[str] | None = None,
) -> int:
    """Run `main(arguments, comm)` as a program, and return the exit code for `sys.exit`.  Collective.

    PETSc reads options with one dash in `argv` (default: the command line); `parser` reads the rest, and may exit.  A
    FetiHomogError on all ranks is printed once and gives its exit code; other exceptions end the job on all ranks.
    """

    def command(words: Sequence[str], comm: Intracomm) -> int:
        main(parsed(parser, words, comm), comm)
        return ExitCode.DONE

    return start(command, argv)


def start(command: Callable[[Sequence[str], Intracomm], int], argv: Sequence[str] | None = None) -> int:
    """Start PETSc and run a command on all ranks; return the exit code.  Collective.

    PETSc takes its options from `argv` (default: the command line) and PETSC_OPTIONS; the command gets the other words.
    A FetiHomogError, also for missing libraries, is printed and gives its exit code, as in `run_main`.
    """
    words, petsc = option_values.split_argv(sys.argv[1:] if argv is None else argv)
    standard_streams.prepare()
    standard_streams.end_on_signals()
    process.prefer_own_toolkits()
    process.ignore_settings_of_the_folder()
    try:
        libraries.require()
    except LibraryError as error:
        if standard_streams.launched_rank() == 0:  # there may be no mpi4py to ask
            standard_streams.complain(*(f"error: {fault}" for fault in error.faults))
        return error.exit_code
    from mpi4py import MPI

    def main() -> int:
        _start_petsc(petsc, MPI.COMM_WORLD)
        return command(words, MPI.COMM_WORLD)

    return mpi_errors.run_main(MPI.COMM_WORLD, main)


def _start_petsc(words: Sequence[str], comm: Intracomm) -> None:
    """Start PETSc with the options in `words` and PETSC_OPTIONS.  Collective.  Raises CaseError and LibraryError."""
    others, of_environment = option_values.split_argv(os.environ.get("PETSC_OPTIONS", "").split())
    options = option_values.named_values([*of_environment, *words])
    faults = [f"PETSC_OPTIONS: {word}: expected options of PETSc and their values" for word in others]
    if "PETSC_OPTIONS_YAML" in os.environ:
        faults.append("PETSC_OPTIONS_YAML: expected PETSC_OPTIONS in its place")
    if faults := [*faults, *option_values.faulty_values(options), *option_table.unknown_options(options)]:
        raise CaseError(*faults)
    os.environ["PETSC_OPTIONS"] = "-skip_petscrc"  # gmsh starts a PETSc of its own
    try:
        libraries.start_petsc([sys.argv[0], *option_values.petsc_words(options)], comm)
    except RuntimeError as error:  # petsc4py raises it before PETSc can name the fault
        raise CaseError(f"PETSc does not start with {' '.join(words)}: {error}") from error


def folder(name: str | Path) -> Path:
    """Convert a folder name to a path.  Raises CaseError for null characters, and for "", which Path takes for "."."""
    if name == "":
        raise CaseError('"" is not a folder name; the current folder is "."')
    if "\0" in str(name):
        raise CaseError(f"{str(name)!r} is not a folder name: names have no null characters")
    return Path(name)


def parsed(parser: argparse.ArgumentParser, words: Sequence[str], comm: Intracomm) -> argparse.Namespace:
    """Parse arguments on all ranks; only rank 0 prints.  Raises SystemExit as argparse does.  Collective."""
    printed = io.StringIO()
    try:
        with contextlib.ExitStack() as redirected:
            redirected.enter_context(contextlib.redirect_stdout(printed))
            if comm.rank:
                redirected.enter_context(contextlib.redirect_stderr(io.StringIO()))
            return parser.parse_args(words)
    except SystemExit:
        mpi_errors.on_root_only(comm, standard_streams.print_product, printed.getvalue().removesuffix("\n"))
        raise


@contextlib.contextmanager
def _started(comm: Intracomm | None, *arguments: object) -> Iterator[Intracomm]:
    """Context manager: start PETSc unless it runs, and yield `comm`, by default MPI.COMM_WORLD.  Collective.

    The `arguments` of the call must be equal on all ranks, and no other thread may be inside.  Raises like `run`.
    """
    standard_streams.prepare()
    process.prefer_own_toolkits()
    libraries.require()
    from mpi4py import MPI

    comm = MPI.COMM_WORLD if comm is None else comm
    if not isinstance(comm, MPI.Intracomm) or comm == MPI.COMM_NULL:
        raise TypeError(f"comm is an intracommunicator of mpi4py, not {comm!r:.80}")
    if (ended := MPI.Is_finalized()) or not RUNNING.acquire(blocking=False):
        raise FetiHomogError("MPI has ended" if ended else "another thread of this process works with PETSc")
    try:
        if "petsc4py.PETSc" not in sys.modules:
            # On all ranks, PETSc would wait for ranks without a case; cases have their own communicators.
            _start_petsc([], MPI.COMM_SELF)
        if comm.size > 1 and len(set(comm.allgather(mpi_errors.agree(comm, _digest, arguments)))) > 1:
            cure = "comm = MPI.COMM_SELF runs a case on each rank alone"
            raise CaseError(f"the {comm.size} ranks have different cases or arguments; {cure}")
        yield comm
    finally:
        RUNNING.release()


def _digest(arguments: tuple[object, ...]) -> str:
    """Digest the arguments of a call: cases, documents, file names, numbers.  Raises like `to_document`."""
    plain = [
        value.resolved() if isinstance(value, Case)
        else toml_files.to_document(value) if isinstance(value, Mapping)
        else value
        for value in arguments
    ]  # fmt: skip
    return toml_files.short_digest(json.dumps(plain, default=str).encode())
