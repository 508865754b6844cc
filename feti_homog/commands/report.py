"""`feti-homog report DIR`: write report.html of a result."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from feti_homog.api import folder
from feti_homog.runtime.environment import require_report
from feti_homog.runtime.standard_streams import say

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm


def add(actions: argparse._SubParsersAction[Any]) -> None:
    """Add the command to those of a parser."""
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
