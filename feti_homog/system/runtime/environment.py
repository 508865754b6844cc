"""Settings of the environment before NumPy, h5py and MPI are imported, and imports of Matplotlib."""

import importlib
import os
import sys
from collections.abc import MutableMapping
from importlib.util import find_spec
from pathlib import Path

SETTINGS = {
    "OMP_NUM_THREADS": "1",  # one core per rank: threads of BLAS would compete with the ranks
    "OMP_THREAD_LIMIT": "1",  # CHOLMOD starts four threads for any OMP_NUM_THREADS, which take half of its time
    "H5PY_ALWAYS_USE_MPI": "1",  # Debian has a serial h5py beside the parallel one
    "OMPI_MCA_btl_vader_single_copy_mechanism": "none",  # containers forbid the default of Open MPI 4
    "OMPI_MCA_smsc": "^cma",  # and of Open MPI 5
}


def prefer_own_toolkits() -> None:
    """Search `mpl_toolkits` first beside the `matplotlib` that Python finds, without importing Matplotlib.

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
    """Import Matplotlib without the `matplotlibrc` of the current folder, and draw without windows.

    Matplotlib would read this file on import, and raise an exception if the file is damaged.
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
    """Set unset variables of SETTINGS; OMP_THREAD_LIMIT only if OMP_NUM_THREADS is 1."""
    for name, value in SETTINGS.items():
        if name != "OMP_THREAD_LIMIT" or environment["OMP_NUM_THREADS"] == "1":
            environment.setdefault(name, value)
