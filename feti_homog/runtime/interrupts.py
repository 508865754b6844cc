"""Ctrl-C and a launcher's or batch system's order to end: one line, and the process ends at once.

Python runs its signal handlers between two of its own steps, which a mesher or a factorization may keep it from for
long, libraries take handlers away, and an exception in the middle of a collective call would leave other ranks waiting.
So the signals are blocked, and a thread waits for them.
"""

from __future__ import annotations

import os
import signal
import threading
import time

from feti_homog.runtime import owners
from feti_homog.runtime.standard_streams import complain

ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGXCPU)  # the last: the limit of CPU time
# Where launchers say the rank of a process before MPI has started.
RANK_VARIABLES = ("OMPI_COMM_WORLD_RANK", "PMIX_RANK", "PMI_RANK", "SLURM_PROCID")
# How long the others wait: after a rank has ended, Open MPI drops what rank 0 prints, and a call of a library may keep
# rank 0 from hearing the signal for a while.
SILENT_SECONDS = 5.0


def end_on_signals() -> None:
    """From now on SIGINT, SIGTERM and SIGXCPU end the process with exit code 128 + signal: 130, 143 and 152.

    Files of locks and unfinished ones are removed before.  Rank 0 tells of it on standard error.  Signals that are
    ignored, as in a background job of a shell, stay so.  Call it before any other thread starts.
    """
    awaited = {number for number in ENDING if signal.getsignal(number) is not signal.SIG_IGN}
    # Of a pipe that its reader has closed, writing tells.
    signal.pthread_sigmask(signal.SIG_BLOCK, {*awaited, signal.SIGPIPE})
    if awaited:
        threading.Thread(target=_wait_and_end, args=(awaited,), daemon=True).start()


def launched_rank() -> int:
    """Return the rank of this process among those that a launcher started, as far as that says it.

    Does not need MPI.
    """
    return int(next((os.environ[name] for name in RANK_VARIABLES if os.environ.get(name, "").isdecimal()), 0))


def _wait_and_end(awaited: set[signal.Signals]) -> None:
    number = signal.sigwait(awaited)
    if launched_rank() == 0:
        complain(f"interrupted by {signal.Signals(number).name}")
    else:
        time.sleep(SILENT_SECONDS)
    owners.remove_files()
    os._exit(128 + number)
