"""`feti-homog plot DIR`: make the pictures of a result again."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from feti_homog.api import folder
from feti_homog.runtime.standard_streams import say

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm


def add(actions: argparse._SubParsersAction[Any]) -> None:
    """Add the command to those of a parser."""
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
