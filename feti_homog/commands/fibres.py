"""`feti-homog fibres`: the fibres of a cross-section as a table."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from feti_homog.api import folder
from feti_homog.system.parallel.mpi_errors import on_root_only
from feti_homog.system.runtime.standard_streams import print_product, say

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

FIBRES_HELP = (
    'Print a row for each fibre, with centre, radius or semi-axes, and phase: the file of [cell] geometry = "table". '
    "The table of a cell gives that cell again."
)


def add(actions: argparse._SubParsersAction[Any]) -> None:
    """Add the command `fibres` to a parser."""
    parser = actions.add_parser("fibres", help="print the fibres of a cell as a table", description=FIBRES_HELP)
    parser.add_argument("source", type=folder, metavar="CASE.toml|DIR", help="a case file, or a folder of results")
    parser.add_argument("--out", type=Path, metavar="FILE.csv", help="write the table to a file instead of printing it")
    parser.set_defaults(action=_fibres)


def _fibres(arguments: argparse.Namespace, comm: Intracomm) -> None:
    from feti_homog.commands import listed_fibres
    from feti_homog.results import output_folder

    text = on_root_only(comm, listed_fibres.table, arguments.source)
    if arguments.out is None:
        on_root_only(comm, print_product, text or "")
    else:
        path = on_root_only(comm, output_folder.write_product, arguments.out, text or "")
        if path is not None:
            say(str(path))
