"""Start the command line: `python -m feti_homog`, and the console script `feti-homog`."""

import os
import signal
import sys

from feti_homog.errors import FetiHomogError
from feti_homog.system.runtime import process, standard_streams


def main() -> int:
    """Prepare the environment, check limits of the system, run the command line, and return the exit code."""
    process.prepare_environment(os.environ)
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)  # until the program listens, Ctrl-C ends it without a traceback
    try:
        process.require_limits()
    except FetiHomogError as error:
        rank = standard_streams.launched_rank()  # other ranks may have other limits
        standard_streams.complain(*(f"error: {f'rank {rank}: ' if rank else ''}{fault}" for fault in error.faults))
        return error.exit_code
    from feti_homog.cli import main as command  # NumPy reads the environment when it is imported

    return command()


if __name__ == "__main__":
    sys.exit(main())
