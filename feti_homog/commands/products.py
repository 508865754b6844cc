"""`feti-homog plot`, `report`, `fields` and `export`: pictures, page, files of VTK and material card of a result."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from feti_homog.api import folder
from feti_homog.runtime.environment import require_report
from feti_homog.runtime.standard_streams import print_product, say

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

EXPORT_HELP = (
    'Print the effective constants of a stiffness or an envelope in plane = "generalized" as a card of a material. Its '
    "axis 1 is the fibre, x3 of the cell; axes 2 and 3 are x1 and x2 of the cell. No unit is converted."
)


def add(actions: argparse._SubParsersAction[Any]) -> None:
    """Add the commands to those of a parser."""
    _add_plot(actions)
    _add_report(actions)
    _add_fields(actions)
    _add_export(actions)


def _add_plot(actions: argparse._SubParsersAction[Any]) -> None:
    parser = actions.add_parser("plot", help="make the pictures of a results folder again")
    parser.add_argument("directory", type=folder, metavar="DIR")
    parser.set_defaults(action=_plot)


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


def _add_report(actions: argparse._SubParsersAction[Any]) -> None:
    words = "write report.html of a results folder: one page with all there is"
    parser = actions.add_parser("report", help=words)
    parser.add_argument("directory", type=folder, metavar="DIR")
    parser.set_defaults(action=_report)


def _report(arguments: argparse.Namespace, comm: Intracomm) -> None:
    from feti_homog.analysis import stored_result
    from feti_homog.parallel.mpi_errors import on_root_only

    require_report()
    on_root_only(comm, stored_result.read, arguments.directory)
    path = on_root_only(comm, _written_report, arguments.directory)
    if path is not None:
        say(str(path))


def _written_report(directory: Path) -> Path:
    """Return the report; only a rank that writes it loads Bokeh."""
    from feti_homog.report.html import page

    return page.write(directory)


def _add_fields(actions: argparse._SubParsersAction[Any]) -> None:
    parser = actions.add_parser(
        "fields", help="write the states of a result, with strains, von Mises and principal stresses, for VTK"
    )
    parser.add_argument("directory", type=folder, metavar="DIR")
    parser.add_argument(
        "--format",
        choices=("vtkhdf", "vtu"),
        default="vtkhdf",
        help="vtkhdf: one file with all states, for ParaView from 5.12 on; vtu: a file for each state and a .pvd",
    )
    parser.set_defaults(action=_fields)


def _fields(arguments: argparse.Namespace, comm: Intracomm) -> None:
    from feti_homog.analysis import stored_result
    from feti_homog.parallel.mpi_errors import on_root_only
    from feti_homog.results import vtk_files

    on_root_only(comm, stored_result.check_to_draw, arguments.directory)
    for path in on_root_only(comm, vtk_files.write, arguments.directory, arguments.format) or []:
        say(str(path))


def _add_export(actions: argparse._SubParsersAction[Any]) -> None:
    parser = actions.add_parser("export", help="print a result as a material card", description=EXPORT_HELP)
    parser.add_argument("directory", type=folder, metavar="DIR")
    programs = "abaqus, calculix, ansys, moose, csv"
    parser.add_argument("--format", default="", metavar="PROGRAM", help=f"program that reads the card: {programs}")
    parser.add_argument("--out", type=Path, metavar="FILE", help="write the card to a file instead of printing it")
    parser.add_argument(
        "--transversely-isotropic",
        dest="symmetry",
        action="store_const",
        const="transversely isotropic",
        default="orthotropic",
        help="the nearest transversely isotropic material, not the one in the axes of the cell",
    )
    parser.set_defaults(action=_export)


def _export(arguments: argparse.Namespace, comm: Intracomm) -> None:
    from feti_homog.parallel.mpi_errors import on_root, on_root_only
    from feti_homog.report.cards import export
    from feti_homog.results import output_folder

    text = on_root(comm, export.card, arguments.directory, arguments.format, arguments.symmetry)
    if arguments.out is not None:
        text = str(on_root(comm, output_folder.write_product, arguments.out, text))
    on_root_only(comm, print_product, text)
