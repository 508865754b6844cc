"""`feti-homog verify DIR`: check a result from its files alone, without MPI and PETSc."""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Sequence
from typing import Any

from feti_homog.api import folder
from feti_homog.errors import EXIT_DEFECT, EXIT_DONE, EXIT_UNCONVERGED, FetiHomogError
from feti_homog.runtime.standard_streams import complain, end_on_signals, launched_rank, prepare, print_product

HELP = (
    "Recompute stresses, equilibrium, periodicity, averages, contact, strengths and energies from result.json and "
    "result.h5, with elements of its own: a line per law, with its largest violation and limit. Exit code 3 if a law "
    "is broken. Needs neither MPI nor PETSc; on several ranks each does all of it, and the first one prints."
)


def add(actions: argparse._SubParsersAction[Any]) -> None:
    """Add the command to those of a parser."""
    words = "check from its files alone that a result obeys its laws"
    parser = actions.add_parser("verify", help=words, description=HELP)
    parser.add_argument("directory", type=folder, metavar="DIR")
    parser.add_argument("--json", action="store_true", help="print the certificate as JSON")


def run(parser: argparse.ArgumentParser, words: Sequence[str]) -> int:
    """Print the certificate of a result; returns the exit code."""
    prepare()
    end_on_signals()
    prints = launched_rank() == 0
    os.environ.pop("H5PY_ALWAYS_USE_MPI", None)  # the serial h5py reads the files
    from feti_homog.verify.certificate import verify

    try:
        arguments = parser.parse_args(words)
        certificate = verify(arguments.directory)
        if prints:
            print_product(json.dumps(certificate.document, indent=1) if arguments.json else certificate.text)
    except PermissionError as error:
        if prints:
            complain(f"error: {error.filename}: {error.strerror}")
        return EXIT_DEFECT
    except FetiHomogError as error:
        if prints:
            complain(*(f"error: {fault}" for fault in error.faults))
        return error.exit_code
    return EXIT_DONE if certificate.holds else EXIT_UNCONVERGED
