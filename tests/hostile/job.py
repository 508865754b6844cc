"""Commands one after the other in one job, as a program that starts the command line; each must end in time."""

import json
import os
import re
import resource
import signal
import sys
from pathlib import Path

from descendants import adopt, children
from mpi4py import MPI

from feti_homog import cli


def limit(processor: float, clock: float) -> None:
    """End the program after so many seconds; zeros take the limits back."""
    signal.setitimer(signal.ITIMER_PROF, processor)
    signal.setitimer(signal.ITIMER_REAL, clock)


def used() -> float:
    """Return the seconds of the processor so far, of this process and of the children that it has waited for."""
    return sum(os.times()[:4])


def peak() -> int:
    """Return the largest memory in MiB, of this process since `begin` and of any child so far."""
    own = re.search(r"VmHWM:\s+(\d+)", Path("/proc/self/status").read_text())
    assert own
    return max(int(own[1]), resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss) >> 10


def begin() -> float:
    """Forget the largest memory so far, and return `used`."""
    Path("/proc/self/clear_refs").write_text("5")
    return used()


def main(commands: Path, processor: float, clock: float) -> None:
    """Run the commands in a file; rank 0 writes output, errors and end of number K beside it: K.1, K.2, K.code.

    The end is the exit code, the seconds of the processor and the largest memory.

    What other ranks print, whose errors are of their own, goes to K.2 too, and processes that a command has left.
    """
    adopt()
    for number, words in enumerate(json.loads(commands.read_text())):
        for stream in (1, 2):
            end = os.open(f"{commands}.{number}.{stream}", os.O_WRONLY | os.O_CREAT | os.O_APPEND)
            os.dup2(end, stream)
            os.close(end)
        limit(processor, clock)
        start = begin()
        try:
            code = cli.main(words)
        except SystemExit as end_of_help:
            code = int(str(end_of_help.code or 0))
        limit(0, 0)
        if left := children():
            print(f"left: processes {left}", file=sys.stderr)
        sys.stdout.flush()
        sys.stderr.flush()
        if MPI.COMM_WORLD.rank == 0:
            Path(f"{commands}.{number}.code").write_text(f"{code} {used() - start:.3f} {peak()}")


if __name__ == "__main__":
    main(Path(sys.argv[1]), float(sys.argv[2]), float(sys.argv[3]))
