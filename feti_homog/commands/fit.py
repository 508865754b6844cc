"""`feti-homog fit`: constants of cases from what was measured."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from feti_homog.api import folder
from feti_homog.commands.sweep import add_case_options

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

HELP = (
    "Fit the unknowns of a file to measured values by least squares, with exact derivatives where there are some. "
    "Every evaluation is kept: the same command resumes. Prints estimates with confidence intervals, their "
    "correlation, and measured beside computed values; unknowns that the data do not determine are named, with exit "
    "code 3."
)


def add(actions: argparse._SubParsersAction[Any]) -> None:
    """Add the command to those of a parser."""
    parser = actions.add_parser("fit", help="fit constants of cases to measured values", description=HELP)
    parser.add_argument("case", type=Path, metavar="FIT.toml", help="a case file with unknown and measured constants")
    parser.add_argument("--out", type=folder, metavar="DIR", required=True, help="folder of the fit")
    add_case_options(parser)
    parser.set_defaults(action=_fit)


def _fit(arguments: argparse.Namespace, comm: Intracomm) -> None:
    from feti_homog.fit import description, execute
    from feti_homog.parallel.mpi_errors import on_root

    fit = on_root(comm, description.load, arguments.case)
    group = comm.size if arguments.ranks_per_case is None else arguments.ranks_per_case
    execute.run(fit, arguments.out, comm, group, arguments.retry, arguments.quiet)
