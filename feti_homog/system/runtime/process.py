"""Prepare and measure the process: environment, limits of the system, memory, import of Matplotlib.

The environment is set before NumPy, h5py and MPI are imported.  If limits are too low, the program would hang or crash
without a message.
"""

import ctypes
import importlib
import math
import os
import resource
import sys
from collections.abc import MutableMapping
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path

from feti_homog.errors import FetiHomogError

SETTINGS = {
    "OMP_NUM_THREADS": "1",  # one core per rank: threads of BLAS would compete with the ranks
    "OMP_THREAD_LIMIT": "1",  # CHOLMOD starts four threads for any OMP_NUM_THREADS, and loses half of its time
    "H5PY_ALWAYS_USE_MPI": "1",  # Debian has a serial h5py beside the parallel one
    "OMPI_MCA_btl_vader_single_copy_mechanism": "none",  # containers forbid the default of Open MPI 4
    "OMPI_MCA_smsc": "^cma",  # and of Open MPI 5
}
# The transport of Open MPI for ranks on one host: its libraries of networks would take 0.2 s to measure the clock.
ONE_HOST = {"OMPI_MCA_pml": "ob1"}
# A rank without a launcher: Open MPI 4 would start a daemon in 0.2 s; without it, ranks share the session folder, which
# must not exist then, nor the pointers to files in it.
ONE_RANK = {
    "OMPI_MCA_ess_singleton_isolated": "1",
    "OMPI_MCA_orte_create_session_dirs": "0",
    "OMPI_MCA_sharedfp": "^sm",
}
# Writing 5 to this file resets the peak of resident memory; see proc(5).
CLEAR_REFS, RESET_PEAK = Path("/proc/self/clear_refs"), "5"
# Bytes of stack for MPI, which does not start with a quarter of this; bytes of addresses for a small run on one rank.
STACK, ADDRESSES = 1 << 20, 1 << 30


def prepare_environment(environment: MutableMapping[str, str]) -> None:
    """Set the variables of SETTINGS that `environment` lacks; OMP_THREAD_LIMIT only if OMP_NUM_THREADS is 1.

    Also sets the variables of ONE_HOST if all ranks are on one host, unless the user chooses transports of Open MPI,
    and those of ONE_RANK without a launcher.
    """
    for name, value in SETTINGS.items():
        if name != "OMP_THREAD_LIMIT" or environment["OMP_NUM_THREADS"] == "1":
            environment.setdefault(name, value)
    is_launched = any(name in environment for name in ("OMPI_COMM_WORLD_SIZE", "PMIX_RANK", "PMI_RANK"))
    on_host, ranks = (environment.get(f"OMPI_COMM_WORLD_{name}") for name in ("LOCAL_SIZE", "SIZE"))
    is_on_one_host = not is_launched or (on_host is not None and on_host == ranks)
    if is_on_one_host and not any(f"OMPI_MCA_{name}" in environment for name in ("pml", "mtl", "btl")):
        environment.update(ONE_HOST)
    if not is_launched:
        environment.update(ONE_RANK)


def require_limits() -> None:
    """Check the limits of stack and addresses, before libraries are loaded.

    Raises:
        FetiHomogError: a limit is below STACK or ADDRESSES; one line for every limit.
    """
    limits = ("stack (ulimit -s)", resource.RLIMIT_STACK, STACK), ("memory (ulimit -v)", resource.RLIMIT_AS, ADDRESSES)
    faults = []
    for name, kind, needed in limits:
        limit = resource.getrlimit(kind)[0]
        if limit != resource.RLIM_INFINITY and limit < needed:
            expected = f"expected at least {needed >> 10} KiB"
            faults.append(f"the {name} of the process is limited to {limit >> 10} KiB; {expected}")
    if faults:
        raise FetiHomogError(*faults)


def trim_memory(kept: int = 0) -> None:
    """Give freed memory of glibc back to the system, if it is more than `kept` bytes."""
    if spare_memory() > kept:
        ctypes.CDLL(None).malloc_trim(0)


def peak_memory() -> int:
    """Return the largest resident memory in bytes since the last `forget_peak`, or else since the start."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


class _Heap(ctypes.Structure):
    """The structure of mallinfo2(3): glibc's counts of its memory."""

    _fields_ = tuple((f"field_{k}", ctypes.c_size_t) for k in range(10))


def spare_memory() -> float:
    """Return the freed bytes that glibc keeps; inf before glibc 2.33, which has no such count."""
    try:
        count = ctypes.CDLL(None).mallinfo2
    except AttributeError:
        return math.inf
    count.restype = _Heap
    return float(count().field_8)  # fordblks


def forget_peak(clear_refs: Path = CLEAR_REFS, kept: int = 0) -> None:
    """Call `trim_memory(kept)`, and reset the peak of memory; if the system refuses, the old peak stays."""
    trim_memory(kept)
    with suppress(OSError):
        clear_refs.write_text(RESET_PEAK)


def prefer_own_toolkits() -> None:
    """Make Python import `mpl_toolkits` first from the folder of its Matplotlib, without importing Matplotlib.

    In an environment with --system-site-packages, Debian's matplotlib-nspkg.pth binds `mpl_toolkits` to Debian's folder
    at the start of Python.  A Matplotlib in the environment cannot import its 3-D axes from there, and would warn.
    """
    matplotlib = find_spec("matplotlib")
    if matplotlib is None or matplotlib.origin is None:
        return
    folder = Path(matplotlib.origin).parents[1] / "mpl_toolkits"
    if folder.is_dir():
        toolkits = importlib.import_module("mpl_toolkits")
        toolkits.__path__ = [str(folder), *(path for path in toolkits.__path__ if path != str(folder))]


def ignore_settings_of_the_folder() -> None:
    """Keep Matplotlib from reading `matplotlibrc` in the current folder and from opening windows.

    Matplotlib reads this file on import, and fails if it is damaged.  So if it exists, import Matplotlib now, from "/".
    """
    os.environ["MPLBACKEND"] = "agg"
    if not os.path.exists("matplotlibrc") or "matplotlib" in sys.modules:
        return
    folder = os.open(".", os.O_RDONLY)
    try:
        os.chdir("/")
        importlib.import_module("matplotlib")
    finally:
        os.fchdir(folder)
        os.close(folder)
