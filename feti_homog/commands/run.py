"""`feti-homog run`, `check`, `keys`, `options`: run and check a case file; the reference of its keys."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from feti_homog.api import folder
from feti_homog.errors import CaseError
from feti_homog.system.parallel import mpi_errors
from feti_homog.system.petsc import option_table
from feti_homog.system.runtime import standard_streams
from feti_homog.typing import Intracomm


def add(actions: argparse._SubParsersAction[Any]) -> None:
    """Add the commands `run` and `check` to a parser."""
    parser = actions.add_parser("run", help="run a case file and write its results to a folder")
    parser.add_argument("case", type=Path, metavar="CASE.toml")
    parser.add_argument("--out", type=folder, required=True, metavar="DIR", help="folder of the results")
    parser.add_argument("--quiet", action="store_true", help="print nothing but errors")
    parser.add_argument("--resume", action="store_true", help="go on from where a path to the same folder was ended")
    parser.set_defaults(action=_run)
    check = actions.add_parser("check", help="validate a case file, mesh its cell and describe the run")
    check.add_argument("case", type=Path, metavar="CASE.toml", help="a file of run, sweep, fit or uncertainty")
    check.set_defaults(action=_check)


def _run(arguments: argparse.Namespace, comm: Intracomm) -> None:
    from feti_homog.analysis import runner
    from feti_homog.case import cases
    from feti_homog.results import output_folder

    case = mpi_errors.on_root(comm, cases.load, arguments.case)
    if arguments.resume and not case.section.is_followed:
        raise CaseError(f'--resume: only for [analysis] type = "path"; this case has "{case.analysis.type}"')
    mpi_errors.on_root(comm, output_folder.usable, arguments.out)
    runner.run(case, arguments.out, comm, arguments.quiet, arguments.resume)


def _check(arguments: argparse.Namespace, comm: Intracomm) -> None:
    from feti_homog.case import sections, toml_files
    from feti_homog.studies import case_runs, fit_file, uncertainty

    document = mpi_errors.on_root(comm, toml_files.read_document, arguments.case)  # once: it may be a pipe
    if document.keys() & {*sections.FIT_SECTIONS}:
        text = mpi_errors.on_root(comm, fit_file.parse, document, arguments.case.parent).describe(comm)
    elif mpi_errors.on_root(comm, uncertainty.is_study, document):
        text = mpi_errors.on_root(comm, uncertainty.parse, document, arguments.case.parent).describe(comm)
    else:
        text = case_runs.describe(document, arguments.case.parent, comm)
    mpi_errors.on_root_only(comm, standard_streams.print_product, text)


def add_reference(actions: argparse._SubParsersAction[Any]) -> None:
    """Add the commands that print references to a parser."""
    keys = actions.add_parser("keys", help="print the keys of a case file and their meaning")
    keys.add_argument("section", nargs="?", metavar="SECTION", help="cell, material, ...; by default all of them")
    keys.set_defaults(action=_keys)
    options = actions.add_parser("options", help="print PETSc's options that the solver takes")
    options.set_defaults(action=_options)


def _keys(arguments: argparse.Namespace, comm: Intracomm) -> None:
    from feti_homog.case import reference

    section = arguments.section
    chosen = reference.tables if section is None else lambda: reference.tables_of(section)
    tables = mpi_errors.on_root_only(comm, chosen)
    mpi_errors.on_root_only(comm, standard_streams.print_product, reference.as_text(tables or []))


def _options(arguments: argparse.Namespace, comm: Intracomm) -> None:
    mpi_errors.on_root_only(comm, standard_streams.print_product, option_table.help_text())
