"""The command line, `feti-homog COMMAND ...`.

Options with a double dash are ours, with a single dash PETSc's.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

from feti_homog.api import folder, parsed, start
from feti_homog.commands import fibres, statistics
from feti_homog.errors import EXIT_DONE, EXIT_UNCONVERGED, CaseError, FetiHomogError
from feti_homog.petsc.command_words import split_argv
from feti_homog.petsc.option_table import help_text
from feti_homog.runtime.environment import require_report
from feti_homog.runtime.interrupts import end_on_signals, launched_rank
from feti_homog.runtime.standard_streams import complain, prepare, print_product, say
from feti_homog.version import __version__

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm


SWEEP_HELP = (
    "Expand the file into numbered cases, check all of them, and run them one after the other. Finished cases are "
    "skipped: the same command resumes. Failed cases are kept and reported at the end, with exit code 3."
)
LAUNCHER_HELP = "Switches of Open MPI go to mpirun: --allow-run-as-root, --oversubscribe (more ranks than cores)."
VERIFY_HELP = (
    "Recompute stresses, equilibrium, periodicity, averages, contact, strengths and energies from result.json and "
    "result.h5, with elements of its own: a line per law, with its largest violation and limit. Exit code 3 if a law "
    "is broken. Needs neither MPI nor PETSc; on several ranks each does all of it, and the first one prints."
)
EXPORT_HELP = (
    'Print the effective constants of a stiffness or an envelope in plane = "generalized" as a card of a material. Its '
    "axis 1 is the fibre, x3 of the cell; axes 2 and 3 are x1 and x2 of the cell. No unit is converted."
)


class Parser(argparse.ArgumentParser):
    """Whose errors are reported once and give exit code 2, like those of the case."""

    def error(self, message: str) -> NoReturn:
        raise CaseError(f"command line: {message} (see --help)")


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command on all ranks, `verify` without MPI; returns the exit code of `errors`."""
    words = sys.argv[1:] if argv is None else list(argv)
    ours, _ = split_argv(words)
    return _verify(ours) if ours[:1] == ["verify"] else start(_command, words)


def _command(words: Sequence[str], comm: Intracomm) -> int:
    parser = command_parser()
    _refuse_single_dashes(parser)
    arguments = parsed(parser, words or ["--help"], comm)
    arguments.action(arguments, comm)
    return EXIT_DONE


def _refuse_single_dashes(parser: Parser) -> None:
    """Refuse our own options among PETSc's, which would take them without a word."""
    from petsc4py import PETSc

    commands = next(action.choices for action in parser._actions if isinstance(action, argparse._SubParsersAction))
    ours = {word[2:] for each in commands.values() for word in each._option_string_actions if word.startswith("--")}
    given = sorted(ours & PETSc.Options().getAll().keys() - {"help"})
    if given:
        raise CaseError(*(f"command line: -{name} is no option of PETSc; did you mean --{name}?" for name in given))


def command_parser() -> Parser:
    parser = Parser(
        prog="feti-homog",
        description="Effective stiffness of fibre composites by FETI, on any number of MPI ranks.",
        epilog=f"{help_text()}\n\n{LAUNCHER_HELP}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"feti-homog {__version__}")
    actions = parser.add_subparsers(dest="command", required=True, parser_class=Parser)
    run = actions.add_parser("run", help="run a case file and write its results to a folder")
    run.add_argument("case", type=Path, metavar="CASE.toml")
    run.add_argument("--out", type=folder, required=True, metavar="DIR", help="folder of the results")
    run.add_argument("--quiet", action="store_true", help="print nothing but errors")
    run.add_argument("--resume", action="store_true", help="go on from where a path to the same folder was ended")
    run.set_defaults(action=_run)
    check = actions.add_parser("check", help="validate a case file, mesh its cell and print what would run")
    check.add_argument("case", type=Path, metavar="CASE.toml")
    check.set_defaults(action=_check)
    _of_results(actions.add_parser("plot", help="make the pictures of a results folder again"), _plot)
    words = "write report.html of a results folder: one page with all there is"
    _of_results(actions.add_parser("report", help=words), _report)
    _add_export(actions.add_parser("export", help="print a result as a material card", description=EXPORT_HELP))
    verify = actions.add_parser("verify", help="check from its files alone that a result obeys its laws",
                                description=VERIFY_HELP)  # fmt: skip
    verify.add_argument("directory", type=folder, metavar="DIR")
    verify.add_argument("--json", action="store_true", help="print the certificate as JSON")
    statistics.add(actions)
    fibres.add(actions)
    _add_sweep(actions.add_parser("sweep", help="run the cases of a file with [sweep]", description=SWEEP_HELP))
    collect = actions.add_parser(
        "collect",
        help="make one table and pictures of the cases of a sweep's folder",
        description="Write sweep.h5 and sweep.csv, with the inputs and outputs of all cases and their statistics over "
        "realisations, and draw what varies. The sweep may still be running: what is there is collected.",
    )
    collect.add_argument("directory", type=folder, metavar="DIR", help="--out of the sweep")
    collect.add_argument("--no-pictures", action="store_true", help="make the tables alone")
    collect.set_defaults(action=_collect)
    _add_reference(actions)
    return parser


def _add_export(export: argparse.ArgumentParser) -> None:
    _of_results(export, _export)
    programs = "abaqus, calculix, ansys, moose, csv"
    export.add_argument("--format", default="", metavar="PROGRAM", help=f"what is to read the card: {programs}")
    export.add_argument("--out", type=Path, metavar="FILE", help="write the card to a file instead of printing it")
    export.add_argument(
        "--transversely-isotropic",
        dest="symmetry",
        action="store_const",
        const="transversely isotropic",
        default="orthotropic",
        help="the nearest transversely isotropic material, not the one in the axes of the cell",
    )


def _of_results(parser: argparse.ArgumentParser, action: Callable[[argparse.Namespace, Intracomm], None]) -> None:
    parser.add_argument("directory", type=folder, metavar="DIR")
    parser.set_defaults(action=action)


def _add_reference(actions: argparse._SubParsersAction[Parser]) -> None:
    keys = actions.add_parser("keys", help="print what the keys of a case file mean")
    keys.add_argument("section", nargs="?", metavar="SECTION", help="cell, material, ...; by default all of them")
    keys.set_defaults(action=_keys)
    schema = actions.add_parser("schema", help="print the JSON Schema of a case file, for editors")
    schema.set_defaults(action=_schema)
    options = actions.add_parser("options", help="print PETSc's options that the solver takes")
    options.set_defaults(action=_options)


def _add_sweep(sweep: argparse.ArgumentParser) -> None:
    sweep.add_argument("case", type=Path, metavar="CASE.toml", help="a case file with a section [sweep]")
    sweep.add_argument("--out", type=folder, metavar="DIR", help="folder of the sweep, in which each case has its own")
    one = sweep.add_mutually_exclusive_group()
    one.add_argument("--list", action="store_true", help="print the cases, with --out also their status; run none")
    one.add_argument("--index", type=int, metavar="K", help="run case K alone, counted from 1, as a job array does")
    sweep.add_argument("--retry", action="store_true", help="compute again what failed before")
    sweep.add_argument(
        "--ranks-per-case",
        type=int,
        metavar="R",
        help="run as many cases at once as there are groups of R ranks (by default one, on all ranks)",
    )
    sweep.add_argument("--quiet", action="store_true", help="print nothing but errors and what failed")
    sweep.set_defaults(action=_sweep)


def _run(arguments: argparse.Namespace, comm: Intracomm) -> None:
    from feti_homog.analysis.runner import run
    from feti_homog.case import case as cases
    from feti_homog.parallel.mpi_errors import on_root
    from feti_homog.results import output_folder

    case = on_root(comm, cases.load, arguments.case)
    if arguments.resume and not case.section.is_followed:
        raise CaseError(f'--resume: only for [analysis] type = "path"; this case has "{case.analysis.type}"')
    on_root(comm, output_folder.usable, arguments.out)
    run(case, arguments.out, comm, arguments.quiet, arguments.resume)


def _check(arguments: argparse.Namespace, comm: Intracomm) -> None:
    from feti_homog.sweep import description

    _print_product(comm, description.of_file(arguments.case, comm))


def _plot(arguments: argparse.Namespace, comm: Intracomm) -> None:
    from feti_homog.analysis import stored_result
    from feti_homog.parallel.mpi_errors import on_root_only
    from feti_homog.report.plots import figures

    on_root_only(comm, stored_result.check_to_draw, arguments.directory)
    paths = on_root_only(comm, figures.plot, arguments.directory)
    if paths == []:
        say(f"{arguments.directory}: nothing to draw: its case has no fields, and no points that make a curve")
    for path in paths or []:
        say(str(path))


def _report(arguments: argparse.Namespace, comm: Intracomm) -> None:
    from feti_homog.analysis import stored_result
    from feti_homog.parallel.mpi_errors import on_root_only

    require_report()
    on_root_only(comm, stored_result.read, arguments.directory)
    path = on_root_only(comm, _written_report, arguments.directory)
    if path is not None:
        say(str(path))


def _written_report(directory: Path) -> Path:
    """The report; only a rank that writes it loads Bokeh."""
    from feti_homog.report.html import page

    return page.write(directory)


def _export(arguments: argparse.Namespace, comm: Intracomm) -> None:
    from feti_homog.parallel.mpi_errors import on_root
    from feti_homog.report.cards import export
    from feti_homog.results import product_file

    text = on_root(comm, export.card, arguments.directory, arguments.format, arguments.symmetry)
    if arguments.out is not None:
        text = str(on_root(comm, product_file.write, arguments.out, text))
    _print_product(comm, text)


def _verify(words: Sequence[str]) -> int:
    """Print the certificate of a result; the exit code."""
    prepare()
    end_on_signals()
    prints = launched_rank() == 0
    os.environ.pop("H5PY_ALWAYS_USE_MPI", None)  # the serial h5py reads the files
    from feti_homog.verify.certificate import verify

    try:
        arguments = command_parser().parse_args(words)
        certificate = verify(arguments.directory)
        if prints:
            print_product(json.dumps(certificate.document, indent=1) if arguments.json else certificate.text)
    except FetiHomogError as error:
        if prints:
            complain(*(f"error: {fault}" for fault in error.faults))
        return error.exit_code
    return EXIT_DONE if certificate.holds else EXIT_UNCONVERGED


def _sweep(arguments: argparse.Namespace, comm: Intracomm) -> None:
    from feti_homog.parallel.mpi_errors import on_root, on_root_only
    from feti_homog.results import output_folder
    from feti_homog.sweep import execute, plan

    if arguments.out is None and not arguments.list:
        raise CaseError("command line: the following arguments are required: --out (see --help)")
    sweep = on_root(comm, plan.load, arguments.case)
    if arguments.list:
        lines = on_root_only(comm, execute.list_cases, sweep, arguments.out) or []
        return _print_product(comm, "\n".join(lines))
    on_root(comm, output_folder.usable, arguments.out)
    if arguments.index is None:
        group = comm.size if arguments.ranks_per_case is None else arguments.ranks_per_case
        execute.run_all(sweep, arguments.out, comm, group, arguments.retry, arguments.quiet)
    else:
        execute.run_one(sweep, arguments.index, arguments.out, comm, arguments.retry, arguments.quiet)


def _collect(arguments: argparse.Namespace, comm: Intracomm) -> None:
    from feti_homog.parallel.mpi_errors import on_root_only
    from feti_homog.sweep import collect

    for line in on_root_only(comm, collect.collect, arguments.directory, not arguments.no_pictures) or []:
        say(line)


def _keys(arguments: argparse.Namespace, comm: Intracomm) -> None:
    from feti_homog.case import reference
    from feti_homog.parallel.mpi_errors import on_root_only

    section = arguments.section
    tables = on_root_only(comm, reference.tables if section is None else partial(reference.tables_of, section))
    _print_product(comm, reference.as_text(tables or []))


def _schema(arguments: argparse.Namespace, comm: Intracomm) -> None:
    from feti_homog.case.json_schema import json_schema

    _print_product(comm, json.dumps(json_schema(), indent=2))


def _options(arguments: argparse.Namespace, comm: Intracomm) -> None:
    _print_product(comm, help_text())


def _print_product(comm: Intracomm, text: str) -> None:
    """Print the text of rank 0, which is all that a command makes.  Collective."""
    from feti_homog.parallel.mpi_errors import on_root_only

    on_root_only(comm, print_product, text)
