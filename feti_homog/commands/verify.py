"""`feti-homog verify`: check a result from its files alone, without MPI and PETSc."""

import json
import os
from collections.abc import Sequence

from feti_homog.commands.parser import command_parser
from feti_homog.errors import ExitCode, FetiHomogError
from feti_homog.system.runtime import standard_streams


def verify(words: Sequence[str]) -> int:
    """Verify the result that the command-line `words` name; return the exit code.  Only the first rank prints."""
    standard_streams.prepare()
    standard_streams.end_on_signals()
    prints = standard_streams.launched_rank() == 0
    os.environ.pop("H5PY_ALWAYS_USE_MPI", None)  # the serial h5py reads the files
    from feti_homog.results import field_guard, output_folder
    from feti_homog.verify import certificate

    try:
        arguments = command_parser().parse_args(words)
        directory = output_folder.result_folder(arguments.directory)
        output_folder.refuse_begun(directory)
        fields = directory / "result.h5"
        if os.path.isfile(fields):
            field_guard.require_own(fields)
        outcome = certificate.verify(directory)
        if prints:
            standard_streams.print_product(json.dumps(outcome.document, indent=1) if arguments.json else outcome.text)
    except PermissionError as error:
        if prints:
            standard_streams.complain(f"error: {error.filename}: {error.strerror}")
        return ExitCode.DEFECT
    except FetiHomogError as error:
        if prints:
            standard_streams.complain(*(f"error: {fault}" for fault in error.faults))
        return error.exit_code
    return ExitCode.DONE if outcome.holds else ExitCode.UNCONVERGED
