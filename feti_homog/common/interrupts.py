"""Ctrl-C and a launcher's or batch system's order to end: one line, and the process ends at once.

Python runs its signal handlers between two of its own steps, which a mesher or a factorization may keep it from for
long, and an exception in the middle of a collective call would leave other ranks waiting.  So a thread listens.
"""

from __future__ import annotations

import os
import signal
import threading

from feti_homog.common import file_locks
from feti_homog.common.standard_streams import complain

ENDING = (signal.SIGINT, signal.SIGTERM)


def end_on_signals(is_speaker: bool) -> None:
    """From now on SIGINT and SIGTERM end the process with exit code 128 + signal: 130 and 143.

    Locks' files are removed before; whatever else a run leaves unfinished, the next one removes.  Signals that are
    ignored, as in a background job of a shell, stay so.  The `is_speaker` tells of it on standard error.
    """
    awaited = [number for number in ENDING if signal.getsignal(number) is not signal.SIG_IGN]
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    signal.set_wakeup_fd(writer, warn_on_full_buffer=False)
    for number in awaited:
        signal.signal(number, lambda *_: None)
    signal.signal(signal.SIGPIPE, signal.SIG_IGN)  # PETSc's handler would end the job
    threading.Thread(target=_wait_and_end, args=(reader, awaited, is_speaker), daemon=True).start()


def _wait_and_end(reader: int, awaited: list[signal.Signals], is_speaker: bool) -> None:
    while (number := os.read(reader, 1)[0]) not in awaited:
        pass
    if is_speaker:
        complain(f"error: interrupted by {signal.Signals(number).name}")
    file_locks.remove_files_of_held_locks()
    os._exit(128 + number)
