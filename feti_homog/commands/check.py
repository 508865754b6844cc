"""`feti-homog check CASE.toml`: validate a case and print what would run."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from feti_homog.commands.output import print_product

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm


def add(actions: argparse._SubParsersAction[Any]) -> None:
    """Add the command to those of a parser."""
    parser = actions.add_parser("check", help="validate a case file, mesh its cell and describe the run")
    parser.add_argument("case", type=Path, metavar="CASE.toml")
    parser.set_defaults(action=_check)


def _check(arguments: argparse.Namespace, comm: Intracomm) -> None:
    from feti_homog.sweep import description

    print_product(comm, description.of_file(arguments.case, comm))
