"""Import the libraries that share one MPI and that pip does not install, and start PETSc."""

import importlib
import re
import resource
import sys
import weakref
from collections.abc import Sequence
from pathlib import Path

from feti_homog.errors import ExitCode, LibraryError
from feti_homog.system.runtime.standard_streams import complain
from feti_homog.typing import Intracomm

DEBIAN_PETSC = Path("/usr/lib/petscdir")
DEBIAN_MODULES = "/usr/lib/python3/dist-packages"
MPI4PY = "install the Debian package python3-mpi4py, or load your cluster's module of mpi4py"
H5PY = "install the Debian packages python3-h5py and python3-h5py-mpi, or load your cluster's module of h5py with MPI"


def require() -> None:
    """Import mpi4py, petsc4py and h5py; this starts MPI but not PETSc.

    Raises:
        LibraryError: a library is missing, broken or without MPI; one line for every library, with the remedy.
    """
    faults = []
    for name, advice in (("mpi4py", MPI4PY), ("petsc4py", petsc4py_advice()), ("h5py", H5PY)):
        try:
            importlib.import_module(name)
        except ModuleNotFoundError as error:
            faults.append(f"{error.name} is not found: {advice}")
        except (ImportError, ValueError) as error:
            faults.append(_unfit(name, error, advice))
    h5py = sys.modules.get("h5py")
    if h5py is not None and not h5py.get_config().mpi:
        remedy = f"import feti_homog before h5py, or {H5PY}, and remove this one"
        faults.append(f"h5py {h5py.__file__} is built without MPI: {remedy}")
    if faults:
        raise LibraryError(*faults)


def start_petsc(words: Sequence[str], comm: Intracomm) -> None:
    """Start PETSc with the words of a command line, the program's name first.  Collective over `comm`.

    PETSc reads no file .petscrc or petscrc, and ends with Python.  A rank on which PETSc cannot end, because its logs
    cannot be written, ends the job: the other ranks would wait.  PETSc lists unread options only with -options_left:
    the program refuses misspelt options itself, and one set of options serves all runs.

    Raises:
        LibraryError: petsc4py cannot be loaded, for example because it was built for another NumPy.
        RuntimeError: PETSc does not start with these words.
    """
    import petsc4py

    is_first = "petsc4py.PETSc" not in sys.modules
    try:
        petsc4py.init([*words, "-skip_petscrc"], comm=comm)
    except (ImportError, ValueError) as error:
        raise LibraryError(_unfit("petsc4py", error, petsc4py_advice())) from error
    from petsc4py import PETSc

    from feti_homog.system.petsc import c_functions

    def end() -> None:
        code = 0 if PETSc.Sys.isFinalized() else c_functions.finalize()  # a caller may have ended PETSc
        if code:
            complain(f"error: PETSc cannot end (error code {code}); the results are complete")
            comm.Abort(ExitCode.DEFECT)

    if is_first:
        weakref.finalize(PETSc, end)  # at exit, after later finalizers, which destroy solvers
    if resource.getrlimit(resource.RLIMIT_AS)[0] != resource.RLIM_INFINITY:
        import numpy as np
        from scipy.linalg import blas

        # Let every BLAS allocate its buffers now: under a limit on addresses, OpenBLAS might later retry forever.
        square = np.eye(200)
        blas.dgemm(1.0, square @ square, square)
        matrix = PETSc.Mat().createDense(square.shape, array=square.copy(), comm=PETSc.COMM_SELF)
        matrix.assemble()
        for petsc_object in (matrix.matMult(matrix), matrix):
            petsc_object.destroy()
    options = PETSc.Options()
    if not options.hasName("options_left"):
        options.setValue("options_left", "no")


def petsc4py_advice(debian: Path = DEBIAN_PETSC, path: Sequence[str] = sys.path) -> str:
    """Return the advice for a missing petsc4py.

    Debian has petsc4py in a folder below `debian`, which PETSC_DIR must name; `path` is Python's search path.
    """
    folders = [folder for folder in debian.glob("petsc*/*-real") if (folder / "lib/python3/dist-packages").is_dir()]
    if not folders:
        return (
            "install the Debian packages python3-petsc4py and python3-petsc4py-real, or load your cluster's module of "
            "PETSc with petsc4py, and make the environment with scripts/bootstrap"
        )
    newest = max(folders, key=lambda folder: [int(number) for number in re.findall(r"\d+", folder.parent.name)])
    environment = "" if DEBIAN_MODULES in path else " and make the environment with --system-site-packages"
    return f"export PETSC_DIR={newest}{environment}, or make the environment with scripts/bootstrap"


def _unfit(name: str, error: Exception, advice: str) -> str:
    """Return the fault of a module that cannot be imported; an error about NumPy means a build for another NumPy."""
    if "numpy" not in str(error):
        return f"{name} cannot be imported ({error}): {advice}"
    import numpy as np

    cure = "install NumPy of the major version that it was built for, as scripts/bootstrap does"
    return f"{name} was built for another NumPy than {np.__version__}: {cure}"
