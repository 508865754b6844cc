"""`feti-homog run`, `check`, `keys`, `options`: run or check a case file; print its keys and the solver options."""

import argparse

from feti_homog.case import cases, sections, toml_files
from feti_homog.errors import CaseError
from feti_homog.system.parallel import mpi_errors
from feti_homog.system.petsc import option_table
from feti_homog.system.runtime import standard_streams
from feti_homog.typing import Intracomm


def run(arguments: argparse.Namespace, comm: Intracomm) -> None:
    """Run a case file, and write its results.  Collective.  Raises CaseError for `--resume` without a path."""
    from feti_homog.analysis import runner
    from feti_homog.results import output_folder

    case = mpi_errors.on_root(comm, cases.load, arguments.case)
    if arguments.resume and not case.section.is_followed:
        raise CaseError(f'--resume: only for [analysis] type = "path"; this case has "{case.analysis.type}"')
    mpi_errors.on_root(comm, output_folder.usable, arguments.out)
    runner.run(case, arguments.out, standard_streams.Progress(comm, arguments.quiet), arguments.resume)


def check(arguments: argparse.Namespace, comm: Intracomm) -> None:
    """Print the description of a case, or of a study (sweep, fit, scatter) and its first case.  Collective."""
    from feti_homog.studies import case_runs, fit_file, uncertainty

    document = mpi_errors.on_root(comm, toml_files.read_document, arguments.case)  # once: it may be a pipe
    if not document.keys().isdisjoint(sections.FIT_SECTIONS):
        text = mpi_errors.on_root(comm, fit_file.parse, document, arguments.case.parent).describe(comm)
    elif mpi_errors.on_root(comm, uncertainty.is_study, document):
        text = mpi_errors.on_root(comm, uncertainty.parse, document, arguments.case.parent).describe(comm)
    else:
        text = case_runs.describe(document, arguments.case.parent, comm)
    mpi_errors.on_root_only(comm, standard_streams.print_product, text)


def keys(arguments: argparse.Namespace, comm: Intracomm) -> None:
    """Print the reference of all keys, or of entries that contain the words in the arguments.  Collective."""
    from feti_homog.case import reference
    from feti_homog.studies import outputs

    word = " ".join(arguments.word)
    text = mpi_errors.on_root_only(comm, reference.text, word, outputs.named(word))
    mpi_errors.on_root_only(comm, standard_streams.print_product, text)


def options(_: argparse.Namespace, comm: Intracomm) -> None:
    """Print the PETSc options that the solver accepts.  Collective."""
    mpi_errors.on_root_only(comm, standard_streams.print_product, option_table.help_text())
