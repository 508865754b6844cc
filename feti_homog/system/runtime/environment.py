"""Settings that a process needs before it imports NumPy, h5py and MPI, and libraries that are optional."""

import importlib
import os
import sys
from collections.abc import MutableMapping
from importlib.util import find_spec
from pathlib import Path

SETTINGS = {
    "OMP_NUM_THREADS": "1",  # one core per rank: threads of BLAS would compete with the ranks
    "OMP_THREAD_LIMIT": "1",  # CHOLMOD starts four whatever the number of threads is: half of its time is theirs
    "H5PY_ALWAYS_USE_MPI": "1",  # Debian has a serial h5py beside the parallel one
    "OMPI_MCA_btl_vader_single_copy_mechanism": "none",  # containers forbid the default of Open MPI 4
    "OMPI_MCA_smsc": "^cma",  # and of Open MPI 5
}


def prefer_own_toolkits() -> None:
    """Let `mpl_toolkits` be found beside the `matplotlib` that will be imported; Matplotlib itself is not imported.

    An environment with --system-site-packages takes `matplotlib` from its own folder, but Debian's
    matplotlib-nspkg.pth has bound `mpl_toolkits` to Debian's at the start of Python: Matplotlib cannot import its 3-D
    axes from there, and warns whenever it is loaded.
    """
    matplotlib = find_spec("matplotlib")
    if matplotlib is None or matplotlib.origin is None:
        return
    folder = Path(matplotlib.origin).parents[1] / "mpl_toolkits"
    if folder.is_dir():
        toolkits = importlib.import_module("mpl_toolkits")
        toolkits.__path__ = [str(folder), *(path for path in toolkits.__path__ if path != str(folder))]


def ignore_settings_of_the_folder() -> None:
    """Load Matplotlib without the current folder's `matplotlibrc`, and let it draw without windows.

    Matplotlib looks for that file first, when it is imported, and ends with a traceback where it is damaged.
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


def prepare(environment: MutableMapping[str, str]) -> None:
    """Set the variables of SETTINGS that are unset; OMP_THREAD_LIMIT only for one thread."""
    for name, value in SETTINGS.items():
        if name != "OMP_THREAD_LIMIT" or environment["OMP_NUM_THREADS"] == "1":
            environment.setdefault(name, value)
