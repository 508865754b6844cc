"""The memory of the process."""

from __future__ import annotations

import ctypes
import resource
from contextlib import suppress
from pathlib import Path

# Writing 5 to this file resets the peak of resident memory; see proc(5).
CLEAR_REFS, RESET_PEAK = Path("/proc/self/clear_refs"), "5"


def trim() -> None:
    """Give freed memory back to the system, which glibc keeps where it lies between blocks in use."""
    ctypes.CDLL(None).malloc_trim(0)


def peak() -> int:
    """Largest resident memory in bytes since `forget_peak`."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def forget_peak(clear_refs: Path = CLEAR_REFS) -> None:
    """Trim, and let the peak begin anew; where the system refuses that, it stays that of the whole process."""
    trim()
    with suppress(OSError):
        clear_refs.write_text(RESET_PEAK)
