"""Runs under mpirun that are watched, and killed with all their processes."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

from support.jobs import launched

DEADLINE = 100.0  # seconds


def descendants(pid: int) -> list[int]:
    """The processes that a process has started, and theirs."""
    children = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[1]) == pid:
            child = int(stat.parent.name)
            children += [child, *descendants(child)]
    return children


def started(ranks: int, *words: str | Path) -> subprocess.Popen[bytes]:
    """`python -m feti_homog words...` on so many ranks, in the background."""
    silent = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    return launched(ranks, "-m", "feti_homog", *words, **silent)


def kill_when(process: subprocess.Popen[bytes], reached: Callable[[], bool], later: float = 0.0) -> None:
    """kill -9 of a process and all that it started, so many seconds after something is reached (or it has ended)."""
    wait_until(process, reached)
    time.sleep(later)
    for pid in [*descendants(process.pid), process.pid]:
        try:
            os.kill(pid, signal.SIGKILL)
        except ProcessLookupError:
            continue
    process.wait()


def wait_until(process: subprocess.Popen[bytes], reached: Callable[[], bool]) -> None:
    """Until something is reached or the process has ended."""
    deadline = time.monotonic() + DEADLINE
    while not reached() and process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.001)
