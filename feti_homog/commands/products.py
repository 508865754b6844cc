"""`feti-homog plot`, `report`, `fields`, `export`, `fibres`, `verify`: products of a result, and its certificate.

`verify` checks a result from its files alone, without MPI and PETSc.
"""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from feti_homog.api import folder
from feti_homog.errors import EXIT_DEFECT, EXIT_DONE, EXIT_UNCONVERGED, CaseError, FetiHomogError
from feti_homog.system.parallel import mpi_errors
from feti_homog.system.runtime import standard_streams
from feti_homog.typing import Intracomm

FIBRES_HELP = (
    'Print a row for each fibre, with centre, radius or semi-axes, and phase: the file of [cell] geometry = "table". '
    "The table of a cell gives that cell again."
)
EXPORT_HELP = (
    'Print the effective constants of a stiffness or an envelope in plane = "generalized" as a card of a material. Its '
    "axis 1 is the fibre, x3 of the cell; axes 2 and 3 are x1 and x2 of the cell. No unit is converted."
)
VERIFY_HELP = (
    "Recompute stresses, equilibrium, periodicity, averages, contact, strengths and energies from result.json and "
    "result.h5, with elements of its own: a line per law, with its largest violation and limit. Exit code 3 if a law "
    "is broken. Needs neither MPI nor PETSc; on several ranks each does all of it, and the first one prints."
)


def add(actions: argparse._SubParsersAction[Any]) -> None:
    """Add the commands for results to a parser."""
    _add(actions, "plot", _plot, "make the pictures of a results folder again")
    _add(actions, "report", _report, "write report.html of a results folder: one page with all there is")
    words = "write the states of a result, with strains, von Mises and principal stresses, for VTK"
    _add(actions, "fields", _fields, words).add_argument(
        "--format",
        choices=("vtkhdf", "vtu"),
        default="vtkhdf",
        help="vtkhdf: one file with all states, for ParaView from 5.12 on; vtu: a file for each state and a .pvd",
    )
    export = _add(actions, "export", _export, "print a result as a material card", EXPORT_HELP)
    programs = "abaqus, calculix, ansys, moose, csv"
    export.add_argument(
        "--format", default="", metavar="PROGRAM", help=f"program that reads the card, needed: {programs}"
    )
    export.add_argument("--out", type=Path, metavar="FILE", help="write the card to a file instead of printing it")
    export.add_argument(
        "--transversely-isotropic",
        dest="symmetry",
        action="store_const",
        const="transversely isotropic",
        default="orthotropic",
        help="the nearest transversely isotropic material, not the one in the axes of the cell",
    )
    verify = _add(actions, "verify", None, "check from its files alone that a result obeys its laws", VERIFY_HELP)
    verify.add_argument("--json", action="store_true", help="print the certificate as JSON")


def add_fibres(actions: argparse._SubParsersAction[Any]) -> None:
    """Add the command `fibres` to a parser."""
    parser = actions.add_parser("fibres", help="print the fibres of a cell as a table", description=FIBRES_HELP)
    parser.add_argument("source", type=folder, metavar="CASE.toml|DIR", help="a case file, or a folder of results")
    parser.add_argument("--out", type=Path, metavar="FILE.csv", help="write the table to a file instead of printing it")
    parser.set_defaults(action=_fibres)


def _add(
    actions: argparse._SubParsersAction[Any],
    name: str,
    action: Callable[[argparse.Namespace, Intracomm], None] | None,
    words: str,
    description: str | None = None,
) -> argparse.ArgumentParser:
    """Return the new parser for a command on a result folder."""
    parser: argparse.ArgumentParser = actions.add_parser(name, help=words, description=description)
    # Without an action it is `verify`, which loads no module of the results that it checks.
    parser.add_argument("directory", type=_result_folder if action else folder, metavar="DIR")
    parser.set_defaults(action=action)
    return parser


def _result_folder(name: str) -> Path:
    """Return a result folder by name; CaseError for a file, or a sweep's folder, whose cases have results."""
    from feti_homog.results import result_json
    from feti_homog.studies import case_folders

    directory = folder(name)
    if os.path.isfile(directory):
        raise CaseError(f"{directory}: expected the folder of a result, not a file")
    if os.path.exists(directory / case_folders.INDEX_FILE) and not os.path.exists(directory / result_json.NAME):
        raise CaseError(
            f"{directory}: expected the folder of a case, such as {directory / 'case-0001'}, not that of a sweep; "
            f"`feti-homog collect {directory}` draws a sweep"
        )
    return directory


def _plot(arguments: argparse.Namespace, comm: Intracomm) -> None:
    from feti_homog.analysis import stored_result
    from feti_homog.report.plots import figures

    mpi_errors.on_root_only(comm, stored_result.check_to_draw, arguments.directory)
    paths = mpi_errors.on_root_only(comm, figures.plot, arguments.directory)
    if paths == []:
        standard_streams.say(
            f"{arguments.directory}: nothing to draw: its case has no fields, and no points that make a curve"
        )
    for path in paths or []:
        standard_streams.say(str(path))


def _report(arguments: argparse.Namespace, comm: Intracomm) -> None:
    from feti_homog.analysis import stored_result
    from feti_homog.report import page

    mpi_errors.on_root_only(comm, stored_result.read, arguments.directory)
    path = mpi_errors.on_root_only(comm, page.write, arguments.directory)
    if path is not None:
        standard_streams.say(str(path))


def _fields(arguments: argparse.Namespace, comm: Intracomm) -> None:
    from feti_homog.analysis import stored_result
    from feti_homog.results import viewed_states

    mpi_errors.on_root_only(comm, stored_result.check_to_draw, arguments.directory)
    for path in mpi_errors.on_root_only(comm, viewed_states.write_vtk, arguments.directory, arguments.format) or []:
        standard_streams.say(str(path))


def _export(arguments: argparse.Namespace, comm: Intracomm) -> None:
    from feti_homog.report.cards import export
    from feti_homog.results import output_folder

    text = mpi_errors.on_root(comm, export.card, arguments.directory, arguments.format, arguments.symmetry)
    if arguments.out is not None:
        text = str(mpi_errors.on_root(comm, output_folder.write_product, arguments.out, text))
    mpi_errors.on_root_only(comm, standard_streams.print_product, text)


def _fibres(arguments: argparse.Namespace, comm: Intracomm) -> None:
    from feti_homog.commands import listed_fibres
    from feti_homog.results import output_folder

    text = mpi_errors.on_root(comm, listed_fibres.table, arguments.source)
    if arguments.out is None:
        mpi_errors.on_root_only(comm, standard_streams.print_product, text)
    elif (path := mpi_errors.on_root_only(comm, output_folder.write_product, arguments.out, text)) is not None:
        standard_streams.say(str(path))


def run_verify(parser: argparse.ArgumentParser, words: Sequence[str]) -> int:
    """Print the certificate of a result; returns the exit code."""
    standard_streams.prepare()
    standard_streams.end_on_signals()
    prints = standard_streams.launched_rank() == 0
    os.environ.pop("H5PY_ALWAYS_USE_MPI", None)  # the serial h5py reads the files
    from feti_homog.verify import certificate

    try:
        arguments = parser.parse_args(words)
        outcome = certificate.verify(arguments.directory)
        if prints:
            standard_streams.print_product(json.dumps(outcome.document, indent=1) if arguments.json else outcome.text)
    except PermissionError as error:
        if prints:
            standard_streams.complain(f"error: {error.filename}: {error.strerror}")
        return EXIT_DEFECT
    except FetiHomogError as error:
        if prints:
            standard_streams.complain(*(f"error: {fault}" for fault in error.faults))
        return error.exit_code
    return EXIT_DONE if outcome.holds else EXIT_UNCONVERGED
