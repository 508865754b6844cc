"""The memory of the process, and limits under which the program would hang or crash without a message."""

import ctypes
import math
import resource
from contextlib import suppress
from pathlib import Path

from feti_homog.errors import FetiHomogError

# Writing 5 to this file resets the peak of resident memory; see proc(5).
CLEAR_REFS, RESET_PEAK = Path("/proc/self/clear_refs"), "5"
# Bytes: a stack for MPI, which does not start with a quarter of it; addresses for a small run on one rank.
STACK, ADDRESSES = 1 << 20, 1 << 30


def trim(kept: int = 0) -> None:
    """Give freed memory of glibc back to the system, if it is more than `kept` bytes."""
    if spare() > kept:
        ctypes.CDLL(None).malloc_trim(0)


def peak() -> int:
    """Return the largest resident memory in bytes since `forget_peak`."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


class _Heap(ctypes.Structure):
    """The structure of mallinfo2(3): counts of glibc about its memory."""

    _fields_ = tuple((f"field_{k}", ctypes.c_size_t) for k in range(10))


def spare() -> float:
    """Return the freed bytes that glibc keeps; inf before glibc 2.33, which has no such count."""
    try:
        count = ctypes.CDLL(None).mallinfo2
    except AttributeError:
        return math.inf
    count.restype = _Heap
    return float(count().field_8)  # fordblks


def forget_peak(clear_refs: Path = CLEAR_REFS, kept: int = 0) -> None:
    """Call `trim`, and reset the peak of memory; if the system refuses, the old peak stays."""
    trim(kept)
    with suppress(OSError):
        clear_refs.write_text(RESET_PEAK)


def require_limits() -> None:
    """Check the limits of stack and addresses, before libraries are loaded.

    Raises:
        FetiHomogError: a limit is below STACK or ADDRESSES; one line for every limit.
    """
    limits = ("stack (ulimit -s)", resource.RLIMIT_STACK, STACK), ("memory (ulimit -v)", resource.RLIMIT_AS, ADDRESSES)
    faults = [
        f"the {name} of the process is limited to {limit >> 10} KiB; expected at least {needed >> 10} KiB"
        for name, kind, needed in limits
        if (limit := resource.getrlimit(kind)[0]) != resource.RLIM_INFINITY and limit < needed
    ]
    if faults:
        raise FetiHomogError(*faults)
