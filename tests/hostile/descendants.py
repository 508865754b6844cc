"""Run a command and wait for all its processes; print a line for each process left after LEFT_S.

Processes whose parents end become children of this one, whatever their session or process group.  No package is
imported: this program starts with each attempt.
"""

import ctypes
import os
import signal
import subprocess
import sys

SET_CHILD_SUBREAPER = 36  # of prctl(2)
LEFT_S = 5  # of the clock


def adopt() -> None:
    """Become the parent of all descendants whose parents end."""
    ctypes.CDLL(None).prctl(SET_CHILD_SUBREAPER, 1)


def report() -> None:
    """Print and kill the processes left, which may hold the output of the command open."""
    for child in children():
        print(f"left: process {child}", file=sys.stderr, flush=True)
        os.kill(child, signal.SIGKILL)


def children() -> list[int]:
    """Return the children of this process that have not ended."""
    with open(f"/proc/self/task/{os.getpid()}/children") as listed:
        return [int(word) for word in listed.read().split()]


def main(words: list[str]) -> int:
    """Return the exit code of the command, as a shell does."""
    adopt()
    code = subprocess.call(words)
    signal.signal(signal.SIGALRM, lambda *_: report())
    signal.alarm(LEFT_S)
    try:
        while True:
            os.wait()
    except ChildProcessError:
        return code if code >= 0 else 128 - code


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
