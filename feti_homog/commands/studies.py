"""`feti-homog sweep`, `collect`, `fit` and `uncertainty`: run many cases, fit constants, propagate scatter."""

import argparse

from feti_homog.errors import CaseError
from feti_homog.results import output_folder
from feti_homog.studies import case_runs, fit_file, sweep_cases
from feti_homog.system.parallel import mpi_errors
from feti_homog.system.runtime import standard_streams
from feti_homog.typing import Intracomm


def sweep(arguments: argparse.Namespace, comm: Intracomm) -> None:
    """List the cases of a sweep, or run all or one.  Collective.  Raises CaseError for a run without `--out`."""
    if arguments.out is None and not arguments.list:
        raise CaseError("command line: the following arguments are required: --out (see --help)")
    cases = mpi_errors.on_root(comm, sweep_cases.load, arguments.case)
    if arguments.list:
        lines = mpi_errors.on_root_only(comm, case_runs.list_cases, cases, arguments.out) or []
        mpi_errors.on_root_only(comm, standard_streams.print_product, "\n".join(lines))
        return
    mpi_errors.on_root(comm, output_folder.usable, arguments.out)
    if arguments.index is None:
        case_runs.run_all(cases, arguments.out, comm, arguments.ranks_per_case, arguments.retry, arguments.quiet)
    else:
        case_runs.run_one(cases, arguments.index, arguments.out, comm, arguments.retry, arguments.quiet)


def collect(arguments: argparse.Namespace, comm: Intracomm) -> None:
    """Write the tables of a sweep and, unless `no_pictures`, its picture; print a summary.  Collective."""
    from feti_homog.studies import collect as tables

    for line in mpi_errors.on_root_only(comm, tables.collect, arguments.directory, not arguments.no_pictures) or []:
        standard_streams.say(line)


def fit(arguments: argparse.Namespace, comm: Intracomm) -> None:
    """Fit the unknowns in a fit file to measured values, and print the estimates.  Collective."""
    study = mpi_errors.on_root(comm, fit_file.load, arguments.case)
    study.run(arguments.out, comm, arguments.ranks_per_case, arguments.retry, arguments.quiet)


def uncertainty(arguments: argparse.Namespace, comm: Intracomm) -> None:
    """Compute and print the scatter of results that the uncertain numbers of a case cause.  Collective."""
    from feti_homog.studies import uncertainty as scatter

    study = mpi_errors.on_root(comm, scatter.load, arguments.case)
    study.run(arguments.out, comm, arguments.ranks_per_case, arguments.retry, arguments.quiet)
