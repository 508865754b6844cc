"""`feti-homog statistics` and `fibres`: how the fibres of a cross-section are placed, and a table of them."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from feti_homog.api import folder
from feti_homog.parallel.mpi_errors import on_root_only
from feti_homog.runtime.standard_streams import print_product, say

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

STATISTICS_HELP = (
    "Print the distances of nearest neighbours, local fibre fractions and directions of pairs, and compare Ripley's "
    "L(r) with simulations of random fibres. Ellipses count as discs of the same area. With --out, write tables of "
    "these, of g(r) and of K(r), and a picture."
)
MOST_SIMULATIONS = 9999
FIBRES_HELP = (
    'Print a row for each fibre, with centre, radius or semi-axes, and phase: the file of [cell] geometry = "table". '
    "The table of a cell gives that cell again."
)


def add(actions: argparse._SubParsersAction[Any]) -> None:
    """Add the commands to those of a parser."""
    _add_statistics(actions)
    _add_fibres(actions)


def _add_statistics(actions: argparse._SubParsersAction[Any]) -> None:
    parser = actions.add_parser(
        "statistics", help="measure how the fibres of a cross-section are placed", description=STATISTICS_HELP
    )
    words = "a table of fibres in a window of a micrograph; or a folder of results, or a case file: periodic cells"
    parser.add_argument("source", type=folder, metavar="FILE.csv|DIR|CASE.toml", help=words)
    parser.add_argument("--out", type=folder, metavar="DIR", help="folder of the tables and the picture")
    parser.add_argument(
        "--model",
        choices=("hard-core", "poisson"),
        default="hard-core",
        help="random reference: fibres of these radii with at least the smallest gap found (the default), or points",
    )
    parser.add_argument(
        "--simulations", type=_simulations, default=39, metavar="N", help="how many are compared (default 39)"
    )
    words = "size of the window, in the unit of the table (default: from a comment in the table)"
    parser.add_argument("--size", type=_length, nargs=2, metavar=("WIDTH", "HEIGHT"), help=words)
    parser.set_defaults(action=_statistics)


def _simulations(word: str) -> int:
    if not word.isdecimal() or not 1 <= int(word) <= MOST_SIMULATIONS:
        raise argparse.ArgumentTypeError(f"{word}: expected an integer from 1 to {MOST_SIMULATIONS}")
    return int(word)


def _length(word: str) -> float:
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not 0 < value < math.inf:
        raise argparse.ArgumentTypeError(f"{word}: expected a length above 0")
    return value


def _statistics(arguments: argparse.Namespace, comm: Intracomm) -> None:
    from feti_homog.commands import fibre_statistics

    size = None if arguments.size is None else tuple(arguments.size)
    words = arguments.source, arguments.out, arguments.model, arguments.simulations, size
    lines = on_root_only(comm, fibre_statistics.run, *words) or []
    if arguments.out is None:
        on_root_only(comm, print_product, "\n".join(lines))
    else:
        for line in lines:
            say(line)


def _add_fibres(actions: argparse._SubParsersAction[Any]) -> None:
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
