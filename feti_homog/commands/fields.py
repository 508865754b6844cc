"""`feti-homog fields DIR`: the states of a result with all fields that follow, as files of VTK."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from feti_homog.api import folder
from feti_homog.runtime.standard_streams import say

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm


def add(actions: argparse._SubParsersAction[Any]) -> None:
    """Add the command to those of a parser."""
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
