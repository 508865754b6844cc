"""Runs under mpirun that are watched, and killed with all their processes."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

from support import LAUNCHER_VARIABLES, ROOT, RUN_VARIABLES

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
    launcher = ["mpirun", "--oversubscribe", "-n", str(ranks)] if ranks else []
    inherited = {k: v for k, v in os.environ.items() if not k.startswith(LAUNCHER_VARIABLES)}
    return subprocess.Popen(
        [*launcher, sys.executable, "-m", "feti_homog", *map(str, words)],
        cwd=ROOT, env=inherited | RUN_VARIABLES, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip


def kill_when(process: subprocess.Popen[bytes], reached: Callable[[], bool]) -> None:
    """kill -9 of a process and all that it started, as soon as something is reached (or it has ended)."""
    wait_until(process, reached)
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
        time.sleep(0.002)
