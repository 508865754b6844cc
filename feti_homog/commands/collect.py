"""`feti-homog collect DIR`: make the table and the pictures of a sweep."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from feti_homog.api import folder
from feti_homog.runtime.standard_streams import say

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

HELP = (
    "Write sweep.h5 and sweep.csv, with the inputs and outputs of all cases and their statistics over realisations, "
    "and pictures of the varied outputs. The sweep may still be running: finished cases are collected."
)


def add(actions: argparse._SubParsersAction[Any]) -> None:
    """Add the command to those of a parser."""
    words = "make one table and pictures of the cases of a sweep's folder"
    parser = actions.add_parser("collect", help=words, description=HELP)
    parser.add_argument("directory", type=folder, metavar="DIR", help="--out of the sweep")
    parser.add_argument("--no-pictures", action="store_true", help="make the tables alone")
    parser.set_defaults(action=_collect)


def _collect(arguments: argparse.Namespace, comm: Intracomm) -> None:
    from feti_homog.parallel.mpi_errors import on_root_only
    from feti_homog.sweep import collect

    for line in on_root_only(comm, collect.collect, arguments.directory, not arguments.no_pictures) or []:
        say(line)
