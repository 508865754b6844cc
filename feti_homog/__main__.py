"""`python -m feti_homog`."""

import signal
import sys

if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # until the program listens, Ctrl-C ends it without a traceback

from feti_homog.cli import main

sys.exit(main())
