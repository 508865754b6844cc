"""Parse the command line: commands, options, and "module.function" of `commands` for each command."""

from __future__ import annotations

import argparse
import re
from pathlib import Path
from typing import NoReturn

from feti_homog import __version__
from feti_homog.api import folder
from feti_homog.errors import CaseError
from feti_homog.system.petsc import option_table

LAUNCHER_HELP = "Switches of Open MPI go to mpirun: --allow-run-as-root, --oversubscribe (more ranks than cores)."
FIBRES_HELP = (
    "Print a table with a row for each fibre: centre, radius or semi-axes, phase, and its number, as in an arc of "
    'debonded. A case with [cell] geometry = "table" reads the table and has the same cell again.'
)
EXPORT_HELP = (
    'Print the constants of a stiffness or envelope in plane = "generalized", or a conductivity, as a material card. '
    "Axis 1 of the card is the fibre, x3 of the cell; axes 2 and 3 are x1 and x2 of the cell. No unit is converted."
)
FIELDS_HELP = "write the states of a result, with strains, von Mises and principal stresses, for VTK"
VERIFY_HELP = (
    "Recompute stresses, equilibrium, periodicity, averages, contact, strengths and energies from result.json and "
    "result.h5, by independent elements; print a line for each law, with its largest violation and limit. Exit code 3 "
    "if a law is broken. Needs neither MPI nor PETSc; on several ranks each does all checks, and the first prints."
)
SWEEP_HELP = (
    "Expand the file into numbered cases, check all of them, and run them one after the other. Finished cases are "
    "skipped: the same command resumes. Failed cases are kept and reported at the end, with exit code 3."
)
COLLECT_HELP = (
    "Write cases.csv with inputs and outputs of all cases, statistics.csv with means and scatter over realisations and "
    "a picture of moduli; print means of constants or peaks. The sweep may still be running, with unfinished paths."
)
FIT_HELP = (
    "Fit the unknowns of a file to measured values by least squares, with exact derivatives where they exist. Every "
    "evaluation is stored: the same command resumes. Prints estimates with confidence intervals, their correlation, "
    "and measured beside computed values. Exit code 3 if the data do not determine some unknowns, which are named, or "
    "if the model does not describe the data (a chance below 1e-3)."
)
SCATTER_HELP = (
    "Find how the scatter of numbers {mean, std} or {mean, cv} of a case spreads to constants, onsets and peaks, with "
    "the share of each number. The scatter between realisations of a random cell and the mesh error stand beside it. "
    "Where a result has no exact derivative, the case also runs one standard deviation below and above the mean. The "
    "same command resumes."
)


class Parser(argparse.ArgumentParser):
    """A command-line parser that raises CaseError for faulty arguments."""

    def error(self, message: str) -> NoReturn:
        hint = "; without it, the same command resumes" if message == "unrecognized arguments: --resume" else ""
        raise CaseError(f"command line: {message}{hint} (see --help)")


def command_parser() -> Parser:
    """Build the parser of `feti-homog`, with all commands."""
    parser = Parser(
        prog="feti-homog",
        description="Effective stiffness of fibre composites by FETI, on any number of MPI ranks.",
        epilog=f"{option_table.help_text()}\n\n{LAUNCHER_HELP}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"feti-homog {__version__}")
    commands = parser.add_subparsers(dest="command", required=True, parser_class=Parser)
    run = _command(commands, "run.run", "run a case file and write its results to a folder")
    run.add_argument("case", type=Path, metavar="CASE.toml")
    run.add_argument("--out", type=folder, required=True, metavar="DIR", help="folder of the results")
    run.add_argument("--quiet", action="store_true", help="print nothing but errors")
    run.add_argument("--resume", action="store_true", help="continue an interrupted path in the same folder")
    check = _command(commands, "run.check", "validate a case file, mesh its cell and describe the run")
    check.add_argument("case", type=Path, metavar="CASE.toml", help="a file for run, sweep, fit or uncertainty")
    _add_products(commands)
    _add_studies(commands)
    keys = _command(commands, "run.keys", "print the keys of a case file and their meaning")
    words = "a section, or a word in names and descriptions: cell, friction, ...; by default all keys, with an index"
    keys.add_argument("word", nargs="*", metavar="WORD", help=words)
    _command(commands, "run.options", "print the PETSc options of the solver")
    return parser


def _add_products(commands: argparse._SubParsersAction[Parser]) -> None:
    """Add the commands that make products of a result, and `fibres`, to the subparsers `commands`."""
    of_result = [
        _command(commands, "products.plot", "draw the pictures of a results folder again"),
        _command(commands, "products.report", "write report.html, one page with everything in a results folder"),
        _command(commands, "products.fields", FIELDS_HELP),
        _command(commands, "products.export", "print a result as a material card", EXPORT_HELP),
        _command(commands, "verify.verify", "check from its files alone that a result obeys its laws", VERIFY_HELP),
    ]
    for parser in of_result:
        parser.add_argument("directory", type=folder, metavar="DIR")
    plot, _, fields, export, verify = of_result
    plot.add_argument("--format", choices=("png", "pdf", "svg"), default="png", help="pdf, svg: vector graphics")
    words = 'draw this state alone: number in result.h5, from 0, label, such as "event 12", or mark, such as "peak"'
    plot.add_argument("--state", metavar="STATE", help=words)
    stresses = ("S11", "S22", "S12", "S33", "S23", "S13", "von_mises", "principal")
    plot.add_argument("--component", choices=stresses, metavar="NAME", help="stress: S11, ..., von_mises or principal")
    plot.add_argument("--size", type=size, metavar="WxH", help="width and height in centimetres, such as 9x7")
    plot.add_argument("--title", metavar="TEXT", help='title of the pictures; "" for none')
    format_help = "vtkhdf: one file with all states, for ParaView from 5.12 on; vtu: a file for each state and a .pvd"
    fields.add_argument("--format", choices=("vtkhdf", "vtu"), default="vtkhdf", help=format_help)
    words = "program that reads the card (required): abaqus, calculix, ansys, moose, csv"
    export.add_argument("--format", default="", metavar="PROGRAM", help=words)
    export.add_argument("--out", type=Path, metavar="FILE", help="write the card to a file instead of printing it")
    export.add_argument(
        "--transversely-isotropic",
        dest="symmetry",
        action="store_const",
        const="transversely isotropic",
        default="orthotropic",
        help="the nearest transversely isotropic material, instead of the computed one",
    )
    verify.add_argument("--json", action="store_true", help="print the certificate as JSON")
    fibres = _command(commands, "products.fibres", "print the fibres of a cell as a table", FIBRES_HELP)
    source = fibres.add_mutually_exclusive_group(required=True)
    source.add_argument("source", type=folder, nargs="?", metavar="CASE.toml|DIR", help="a case file or results folder")
    text = "find round fibres in a micrograph; --out FILE.csv also draws them, in FILE_circles.png"
    source.add_argument("--image", type=Path, metavar="IMAGE", help=text)
    fibres.add_argument("--pixel", type=length, default=1.0, metavar="LENGTH", help="side of a pixel of the image")
    fibres.add_argument("--out", type=Path, metavar="FILE.csv", help="write the table to a file instead of printing it")


def _add_studies(commands: argparse._SubParsersAction[Parser]) -> None:
    """Add the commands for studies of many cases to the subparsers `commands`."""
    sweep = _command(commands, "studies.sweep", "run the cases of a file with [sweep]", SWEEP_HELP)
    sweep.add_argument("case", type=Path, metavar="CASE.toml", help="a case file with a section [sweep]")
    sweep.add_argument("--out", type=folder, metavar="DIR", help="folder of the sweep, with a subfolder for each case")
    one = sweep.add_mutually_exclusive_group()
    one.add_argument("--list", action="store_true", help="print the cases, with --out also their status; run none")
    one.add_argument("--index", type=integer, metavar="K", help="run case K alone, counted from 1, as a job array does")
    words = "make the tables and the picture of a sweep folder"
    collect = _command(commands, "studies.collect", words, COLLECT_HELP)
    collect.add_argument("directory", type=folder, metavar="DIR", help="--out of the sweep")
    collect.add_argument("--no-pictures", action="store_true", help="make only the tables")
    fit = _command(commands, "studies.fit", "fit constants of cases to measured values", FIT_HELP)
    fit.add_argument("case", type=Path, metavar="FIT.toml", help="a case file with unknown and measured constants")
    fit.add_argument("--out", type=folder, metavar="DIR", required=True, help="folder of the fit")
    scatter = _command(commands, "studies.uncertainty", "propagate the scatter of numbers to results", SCATTER_HELP)
    scatter.add_argument("case", type=Path, metavar="CASE.toml", help="a case file with uncertain numbers")
    scatter.add_argument("--out", type=folder, metavar="DIR", required=True, help="folder of the runs")
    ranks_help = "ranks for each case; groups of R ranks run cases at the same time (by default R is all ranks)"
    for parser in (sweep, fit, scatter):
        parser.add_argument("--retry", action="store_true", help="compute failed cases again")
        parser.add_argument("--ranks-per-case", type=integer, metavar="R", help=ranks_help)
        parser.add_argument("--quiet", action="store_true", help="print errors and failed cases only")


def _command(
    commands: argparse._SubParsersAction[Parser], action: str, summary: str, description: str | None = None
) -> Parser:
    """Add the command that calls `action` = "module.function", with the function's name; return its parser."""
    parser = commands.add_parser(action.partition(".")[2], help=summary, description=description)
    parser.set_defaults(action=action)
    return parser


def integer(word: str) -> int:
    """Convert a word to an integer of at most nine digits.  Raises ValueError for other words."""
    if not re.fullmatch(r"[+-]?[0-9]{1,9}", word):
        raise ValueError
    return int(word)


def length(word: str) -> float:
    """Convert a word to a length above 0.  Raises ArgumentTypeError for other words."""
    if not re.fullmatch(r"[0-9]{0,9}\.?[0-9]{0,9}(e-?[0-9])?", word) or not re.search("[1-9]", word.partition("e")[0]):
        raise argparse.ArgumentTypeError(f"{word!r}: expected a length above 0, such as 0.5")
    return float(word)


def size(word: str) -> tuple[float, float]:
    """Convert a word such as 9x7.5 to two lengths in centimetres, each at least 2.  Raises ArgumentTypeError."""
    is_pair = re.fullmatch(r"[0-9]{1,3}(\.[0-9]{1,3})?x[0-9]{1,3}(\.[0-9]{1,3})?", word)
    if not is_pair or min(map(float, word.split("x"))) < 2.0:  # less than a picture's text needs
        raise argparse.ArgumentTypeError(f"{word!r}: expected width and height of at least 2 cm, such as 9x7")
    width, height = map(float, word.split("x"))
    return width, height
