"""`feti-homog sweep`, `collect`, `fit` and `uncertainty`: many cases, constants from them, scatter of results."""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

from feti_homog.api import folder
from feti_homog.errors import CaseError
from feti_homog.system.parallel import mpi_errors
from feti_homog.system.runtime import standard_streams
from feti_homog.typing import Intracomm

Action = Callable[[argparse.Namespace, Intracomm], None]
SWEEP_HELP = (
    "Expand the file into numbered cases, check all of them, and run them one after the other. Finished cases are "
    "skipped: the same command resumes. Failed cases are kept and reported at the end, with exit code 3."
)
COLLECT_HELP = (
    "Write cases.csv, the inputs and outputs of all cases, statistics.csv, those over realisations, and a "
    "picture of moduli over the fibre fraction. The sweep may still be running: finished cases are collected."
)

FIT_HELP = (
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
    """Add the commands to a parser."""
    sweep = actions.add_parser("sweep", help="run the cases of a file with [sweep]", description=SWEEP_HELP)
    sweep.add_argument("case", type=Path, metavar="CASE.toml", help="a case file with a section [sweep]")
    sweep.add_argument("--out", type=folder, metavar="DIR", help="folder of the sweep, in which each case has its own")
    one = sweep.add_mutually_exclusive_group()
    one.add_argument("--list", action="store_true", help="print the cases, with --out also their status; run none")
    one.add_argument("--index", type=integer, metavar="K", help="run case K alone, counted from 1, as a job array does")
    _add_case_options(sweep, _sweep)
    words = "make one table and a picture of the cases of a sweep's folder"
    collect = actions.add_parser("collect", help=words, description=COLLECT_HELP)
    collect.add_argument("directory", type=folder, metavar="DIR", help="--out of the sweep")
    collect.add_argument("--no-pictures", action="store_true", help="make the tables alone")
    collect.set_defaults(action=_collect)
    fit = actions.add_parser("fit", help="fit constants of cases to measured values", description=FIT_HELP)
    fit.add_argument("case", type=Path, metavar="FIT.toml", help="a case file with unknown and measured constants")
    fit.add_argument("--out", type=folder, metavar="DIR", required=True, help="folder of the fit")
    _add_case_options(fit, _fit)
    scatter = actions.add_parser("uncertainty", help="pass scatter of numbers on to results", description=SCATTER_HELP)
    scatter.add_argument("case", type=Path, metavar="CASE.toml", help="a case file with uncertain numbers")
    scatter.add_argument("--out", type=folder, metavar="DIR", required=True, help="folder of the runs")
    _add_case_options(scatter, _uncertainty)


def integer(word: str) -> int:
    """Return the integer in a word without the underscores that Python allows. Raises ValueError."""
    if not re.fullmatch(r"[+-]?[0-9]{1,9}", word):
        raise ValueError
    return int(word)


def _add_case_options(parser: argparse.ArgumentParser, action: Action) -> None:
    """Give a command that runs many cases its action and the options of all such commands."""
    parser.set_defaults(action=action)
    parser.add_argument("--retry", action="store_true", help="compute failed cases again")
    parser.add_argument(
        "--ranks-per-case",
        type=integer,
        metavar="R",
        help="run as many cases at once as there are groups of R ranks (by default one, on all ranks)",
    )
    parser.add_argument("--quiet", action="store_true", help="print errors and failed cases only")


def _case_options(arguments: argparse.Namespace, comm: Intracomm) -> tuple[int, bool, bool]:
    """Return the ranks of a case, by default all, and whether failed cases run again and nothing is printed."""
    group = comm.size if arguments.ranks_per_case is None else arguments.ranks_per_case
    return group, arguments.retry, arguments.quiet


def _sweep(arguments: argparse.Namespace, comm: Intracomm) -> None:
    from feti_homog.results import output_folder
    from feti_homog.studies import case_runs, sweep_cases

    if arguments.out is None and not arguments.list:
        raise CaseError("command line: the following arguments are required: --out (see --help)")
    sweep = mpi_errors.on_root(comm, sweep_cases.load, arguments.case)
    if arguments.list:
        lines = mpi_errors.on_root_only(comm, case_runs.list_cases, sweep, arguments.out) or []
        mpi_errors.on_root_only(comm, standard_streams.print_product, "\n".join(lines))
        return
    mpi_errors.on_root(comm, output_folder.usable, arguments.out)
    if arguments.index is None:
        case_runs.run_all(sweep, arguments.out, comm, *_case_options(arguments, comm))
    else:
        case_runs.run_one(sweep, arguments.index, arguments.out, comm, arguments.retry, arguments.quiet)


def _collect(arguments: argparse.Namespace, comm: Intracomm) -> None:
    from feti_homog.studies import collect

    for line in mpi_errors.on_root_only(comm, collect.collect, arguments.directory, not arguments.no_pictures) or []:
        standard_streams.say(line)


def _fit(arguments: argparse.Namespace, comm: Intracomm) -> None:
    from feti_homog.studies import fit_file

    mpi_errors.on_root(comm, fit_file.load, arguments.case).run(arguments.out, comm, *_case_options(arguments, comm))


def _uncertainty(arguments: argparse.Namespace, comm: Intracomm) -> None:
    from feti_homog.studies import uncertainty

    mpi_errors.on_root(comm, uncertainty.load, arguments.case).run(arguments.out, comm, *_case_options(arguments, comm))
