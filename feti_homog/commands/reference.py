"""`feti-homog keys`, `schema`, `options`: print the reference of case files and of PETSc options."""

from __future__ import annotations

import argparse
import json
from functools import partial
from typing import TYPE_CHECKING, Any

from feti_homog.parallel.mpi_errors import on_root_only
from feti_homog.petsc.option_table import help_text
from feti_homog.runtime.standard_streams import print_product

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm


def add(actions: argparse._SubParsersAction[Any]) -> None:
    """Add the commands to those of a parser."""
    keys = actions.add_parser("keys", help="print the keys of a case file and their meaning")
    keys.add_argument("section", nargs="?", metavar="SECTION", help="cell, material, ...; by default all of them")
    keys.set_defaults(action=_keys)
    schema = actions.add_parser("schema", help="print the JSON Schema of a case file, for editors")
    schema.set_defaults(action=_schema)
    options = actions.add_parser("options", help="print PETSc's options that the solver takes")
    options.set_defaults(action=_options)


def _keys(arguments: argparse.Namespace, comm: Intracomm) -> None:
    from feti_homog.case import reference

    section = arguments.section
    tables = on_root_only(comm, reference.tables if section is None else partial(reference.tables_of, section))
    on_root_only(comm, print_product, reference.as_text(tables or []))


def _schema(arguments: argparse.Namespace, comm: Intracomm) -> None:
    from feti_homog.case.json_schema import json_schema

    on_root_only(comm, print_product, json.dumps(json_schema(), indent=2))


def _options(arguments: argparse.Namespace, comm: Intracomm) -> None:
    on_root_only(comm, print_product, help_text())
