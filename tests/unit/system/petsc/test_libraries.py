"""Where mpi4py, petsc4py or h5py is missing or does not fit, a line for each gives the remedy."""

import os
import subprocess
import sys

import pytest
from petsc4py import PETSc
from support.jobs import PATIENCE

from feti_homog.errors import ExitCode
from feti_homog.system.petsc.libraries import DEBIAN_MODULES, petsc4py_advice
from feti_homog.system.petsc.options_database import case_options

MISSING = "raise ModuleNotFoundError(f'No module named {__name__!r}', name=__name__)"
OTHER_NUMPY = "def init(*_, **__): raise ValueError('numpy.dtype size changed, may indicate binary incompatibility')"
SERIAL = "class Configuration: mpi = False\nget_config = Configuration"


def faults(folder, **modules: str) -> list[str]:
    """Return the output of the program where these modules precede the installed ones."""
    folder.mkdir(exist_ok=True)
    for name, text in modules.items():
        (folder / f"{name}.py").write_text(text)
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("OMPI_", "PMIX_"))}
    job = subprocess.run(
        [sys.executable, "-m", "feti_homog", "options"],
        env={**environment, "PYTHONPATH": str(folder)},
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )
    assert job.returncode == ExitCode.INPUT and job.stdout == ""
    return job.stderr.splitlines()


@pytest.mark.parametrize("name", ["mpi4py", "petsc4py", "h5py"])
def test_one_line_says_what_is_missing_and_what_to_do(tmp_path, name):
    (line,) = faults(tmp_path, **{name: MISSING})
    assert line.startswith(f"error: {name} is not found: ")
    assert "PETSC_DIR" in line or "install the Debian package" in line


def test_all_that_is_missing_is_reported_at_once(tmp_path):
    first, second, *_ = faults(tmp_path, petsc4py=MISSING, mpi4py=MISSING)
    assert (first.split()[1], second.split()[1]) == ("mpi4py", "petsc4py")


def test_libraries_of_another_build_are_refused(tmp_path):
    (line,) = faults(tmp_path, h5py=SERIAL)
    assert "is built without MPI" in line and str(tmp_path / "h5py.py") in line
    (line,) = faults(tmp_path / "petsc4py", petsc4py=OTHER_NUMPY)
    assert line.startswith("error: petsc4py was built for another NumPy than ")


def test_the_advice_names_debians_newest_folder_with_petsc4py(tmp_path):
    for name in ("petsc3.9/x86_64-linux-gnu-real", "petsc3.22/x86_64-linux-gnu-real"):
        (tmp_path / name / "lib/python3/dist-packages").mkdir(parents=True)
    (tmp_path / "petsc3.24/x86_64-linux-gnu-real").mkdir(parents=True)
    folder = tmp_path / "petsc3.22/x86_64-linux-gnu-real"
    assert petsc4py_advice(tmp_path, [DEBIAN_MODULES]).startswith(f"export PETSC_DIR={folder}, or ")
    assert f"{folder} and make the environment with --system-site-packages, or" in petsc4py_advice(tmp_path, [])
    assert petsc4py_advice(tmp_path / "none").startswith("install the Debian packages python3-petsc4py")


@pytest.mark.parametrize("asked", [False, True])
def test_petsc_lists_options_that_nobody_read_only_if_asked(asked):
    words = ["options", "-feti_pc_type", "lumped", *(["-options_left"] if asked else [])]
    job = subprocess.run([sys.executable, "-m", "feti_homog", *words], capture_output=True, text=True, timeout=PATIENCE)
    assert job.returncode == ExitCode.DONE
    assert ("name:-feti_pc_type" in job.stdout) == asked


def test_a_case_leaves_the_list_switched_off():
    database = PETSc.Options()
    database.setValue("options_left", "no")
    try:
        with case_options({}):
            assert database.getString("options_left") == "no"
    finally:
        database.delValue("options_left")
