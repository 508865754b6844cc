"""`feti-homog fit` and `uncertainty`: constants of cases from what was measured; scatter of results."""

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


SCATTER_HELP = (
    "Find the scatter of the constants, onsets and peaks of a case whose numbers are {mean, std} or {mean, cv}, with "
    "each number's share, beside that between the realisations of a random cell and the error of the mesh. Where a "
    "result has no exact derivative, the case runs with the number one standard deviation less and more. The same "
    "command resumes."
)


def add(actions: argparse._SubParsersAction[Any]) -> None:
    """Add the commands to those of a parser."""
    _add_fit(actions)
    parser = actions.add_parser("uncertainty", help="pass scatter of numbers on to results", description=SCATTER_HELP)
    parser.add_argument("case", type=Path, metavar="CASE.toml", help="a case file with uncertain numbers")
    parser.add_argument("--out", type=folder, metavar="DIR", required=True, help="folder of the runs")
    add_case_options(parser)
    parser.set_defaults(action=_uncertainty)


def _add_fit(actions: argparse._SubParsersAction[Any]) -> None:
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


def _uncertainty(arguments: argparse.Namespace, comm: Intracomm) -> None:
    from feti_homog.fit import scatter
    from feti_homog.parallel.mpi_errors import on_root

    study = on_root(comm, scatter.load, arguments.case)
    group = comm.size if arguments.ranks_per_case is None else arguments.ranks_per_case
    scatter.run(study, arguments.out, comm, group, arguments.retry, arguments.quiet)
