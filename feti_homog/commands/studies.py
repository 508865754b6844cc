"""`feti-homog sweep`, `collect`, `fit` and `uncertainty`: run many cases, fit constants, propagate scatter."""

import argparse

from feti_homog.errors import CaseError
from feti_homog.results import output_folder
from feti_homog.studies import case_runs, fit_file, sweep_cases
from feti_homog.system.parallel import mpi_errors
from feti_homog.system.runtime import standard_streams
from feti_homog.typing import Intracomm


def sweep(arguments: argparse.Namespace, comm: Intracomm) -> None:
    """List the sweep cases, or run all cases or a single case.  Collective.  Raises CaseError if `--out` is missing."""
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
    """Write the tables and, unless `no_pictures`, the picture of a sweep; print a summary.  Collective."""
    from feti_homog.studies import collect as tables

    for line in mpi_errors.on_root_only(comm, tables.collect, arguments.directory, not arguments.no_pictures) or []:
        standard_streams.say(line)


def fit(arguments: argparse.Namespace, comm: Intracomm) -> None:
    """Fit the unknowns of a file to measured values.  Collective."""
    study = mpi_errors.on_root(comm, fit_file.load, arguments.case)
    study.run(arguments.out, comm, arguments.ranks_per_case, arguments.retry, arguments.quiet)


def uncertainty(arguments: argparse.Namespace, comm: Intracomm) -> None:
    """Compute the scatter of results that uncertain numbers cause.  Collective."""
    from feti_homog.studies import uncertainty as scatter

    study = mpi_errors.on_root(comm, scatter.load, arguments.case)
    study.run(arguments.out, comm, arguments.ranks_per_case, arguments.retry, arguments.quiet)
