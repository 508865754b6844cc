"""`feti-homog export DIR`: print the constants of a result as a material card."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from feti_homog.api import folder
from feti_homog.commands.output import print_product

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

HELP = (
    'Print the effective constants of a stiffness or an envelope in plane = "generalized" as a card of a material. Its '
    "axis 1 is the fibre, x3 of the cell; axes 2 and 3 are x1 and x2 of the cell. No unit is converted."
)


def add(actions: argparse._SubParsersAction[Any]) -> None:
    """Add the command to those of a parser."""
    parser = actions.add_parser("export", help="print a result as a material card", description=HELP)
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
    from feti_homog.parallel.mpi_errors import on_root
    from feti_homog.report.cards import export
    from feti_homog.results import output_folder

    text = on_root(comm, export.card, arguments.directory, arguments.format, arguments.symmetry)
    if arguments.out is not None:
        text = str(on_root(comm, output_folder.write_product, arguments.out, text))
    print_product(comm, text)
