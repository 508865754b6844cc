"""Start the command line: `python -m feti_homog`, and the console script `feti-homog`."""

import os
import signal
import sys

from feti_homog.errors import FetiHomogError
from feti_homog.system.runtime import process_memory
from feti_homog.system.runtime.environment import prepare
from feti_homog.system.runtime.standard_streams import complain, launched_rank


def main() -> int:
    """Run the command line in a prepared environment; returns the exit code."""
    prepare(os.environ)
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)  # until the program listens, Ctrl-C ends it without a traceback
    try:
        process_memory.require_limits()
    except FetiHomogError as error:
        rank = launched_rank()  # others may have other limits
        complain(*(f"error: {f'rank {rank}: ' if rank else ''}{fault}" for fault in error.faults))
        return error.exit_code
    from feti_homog.cli import main as command  # NumPy reads the environment when it is imported

    return command()


if __name__ == "__main__":
    sys.exit(main())
