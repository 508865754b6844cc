"""Check that every module that feti_homog needs can be used; name missing modules and end with exit code 1.

With --quick, only look for the modules, without importing them. With --versions, print the versions found.
"""

import importlib
import importlib.metadata
import importlib.util
import os
import platform
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

# module: what provides it
PROVIDERS = {
    "mpi4py.MPI": "Debian package python3-mpi4py, or your cluster's mpi4py module",
    "petsc4py.PETSc": "Debian packages python3-petsc4py python3-petsc4py-real, or your cluster's PETSc "
    "module that has petsc4py, with PETSC_DIR set",
    "h5py": "Debian packages python3-h5py python3-h5py-mpi, or your cluster's h5py module built with MPI",
    "gmsh": "scripts/requirements.txt; its libraries: Debian packages libglu1-mesa libgl1 libxrender1 "
    "libxcursor1 libxft2 libxinerama1 libgomp1",
    **dict.fromkeys(
        [
            "numpy",
            "scipy",
            "matplotlib",
            "selenium",
            "pymetis",
            "tqdm",
            "tomli_w",
            "pytest",
            "hypothesis",
            "coverage",
            "ruff",
            "codespell_lib",
            "mypy",
            "clarabel",
            "feti_homog",
        ],
        "scripts/requirements.txt and pip install -e .",
    ),
}

# module: (what else it must fulfil, in words; the test)
DEMANDS: dict[str, tuple[str, Callable[[Any], bool]]] = {
    "h5py": ("built with MPI", lambda h5py: h5py.get_config().mpi),
    "petsc4py.PETSc": ("built with real numbers", lambda petsc: petsc.ScalarType().dtype.kind == "f"),
}


def fault_found(module: str) -> str:
    """Return why the package of a module is not on the path, or ""; import nothing."""
    if not importlib.util.find_spec(module.split(".")[0]):
        return "not found"
    constraints = Path(sys.prefix) / "constraints.txt"
    if module != "numpy" or not constraints.is_file():
        return ""
    return numpy_fault(constraints.read_text(), importlib.metadata.version("numpy"))


def numpy_fault(constraint: str, installed: str) -> str:
    """Return why the installed NumPy has not the major version of a constraint such as numpy==1.26.4, or ""."""
    wanted = constraint.strip().partition("==")[2]
    same = wanted.split(".")[0] == installed.split(".")[0]
    return "" if same else f"version {installed}: petsc4py was built for {wanted}"


def fault_imported(module: str) -> str:
    """Return why the module cannot be imported or lacks a required feature, or ""."""
    try:
        imported = importlib.import_module(module)
    except Exception as error:  # a broken module may raise anything
        return f"{type(error).__name__}: {error}"
    words, fulfils = DEMANDS.get(module, ("", lambda _: True))
    return fault_found(module) if fulfils(imported) else f"must be {words}"


def versions() -> str:
    """Return in one line the versions that results may depend on."""
    import h5py
    import numpy
    import scipy
    from mpi4py import MPI
    from petsc4py import PETSc

    mpi = MPI.Get_library_version().split(",")[0]
    petsc = ".".join(map(str, PETSc.Sys.getVersion()))
    return (
        f"Python {platform.python_version()}, PETSc {petsc}, {mpi}, mpi4py {importlib.metadata.version('mpi4py')}, "
        f"HDF5 {h5py.version.hdf5_version}, h5py {h5py.__version__}, NumPy {numpy.__version__}, "
        f"SciPy {scipy.__version__}, gmsh {importlib.metadata.version('gmsh')}"
    )


def main() -> int:
    os.environ["H5PY_ALWAYS_USE_MPI"] = "1"
    if "--versions" in sys.argv:
        print(versions())
        return 0
    fault = fault_found if "--quick" in sys.argv else fault_imported
    faults = {module: fault(module) for module in PROVIDERS}
    lines = [f"{module}: {text} (from: {PROVIDERS[module]})" for module, text in faults.items() if text]
    if not shutil.which("mpirun"):
        lines.append("mpirun: not found (from: Debian package openmpi-bin, or your cluster's MPI module)")
    if lines:
        print("missing or unfit:", *lines, sep="\n  ", file=sys.stderr)
    return int(bool(lines))


if __name__ == "__main__":
    sys.exit(main())
