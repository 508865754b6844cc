"""Programs that tests start: Python programs under mpirun, or without it."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
LAUNCHER_VARIABLES = ("OMPI_", "PMIX_", "ORTE_", "PMI_")
PATIENCE = 900.0  # seconds, also on a busy machine more than any job takes: what takes longer hangs
RUN_VARIABLES = {
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
    "OMPI_MCA_btl_vader_single_copy_mechanism": "none",  # Open MPI 4
    "OMPI_MCA_smsc": "^cma",  # the same of Open MPI 5
    "OMPI_MCA_btl_tcp_if_include": "lo",  # which complains of networks that lead nowhere
    "OMPI_MCA_mpi_yield_when_idle": "1",  # jobs share the cores
    "OMPI_MCA_hwloc_base_binding_policy": "none",  # all of them: rank 0 of every small job would be bound to the first
    "PRTE_MCA_hwloc_default_binding_policy": "none",  # the same of Open MPI 5
    "OMP_NUM_THREADS": "1",
    "OMP_THREAD_LIMIT": "1",
    "H5PY_ALWAYS_USE_MPI": "1",
}


def environment() -> dict[str, str]:
    """Return the environment of a separate job: without the variables of the launcher of these tests."""
    return {k: v for k, v in os.environ.items() if not k.startswith(LAUNCHER_VARIABLES)} | RUN_VARIABLES


def launched(ranks: int, *args: str | Path, cwd: Path = ROOT, **options: Any) -> subprocess.Popen[Any]:
    """`python args...` on so many ranks, started; ranks = 0 starts it without mpirun.  Options are those of Popen."""
    launcher = ["mpirun", "--oversubscribe", "-n", str(ranks)] if ranks else []
    return subprocess.Popen([*launcher, sys.executable, *map(str, args)], cwd=cwd, env=environment(), **options)


def mpirun(ranks: int, *args: str | Path, cwd: Path = ROOT) -> subprocess.CompletedProcess[str]:
    """Run `launched` to its end, with its output as text.

    Raises subprocess.TimeoutExpired if it takes longer than PATIENCE; nothing is left running.
    """
    process = launched(ranks, *args, cwd=cwd, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    try:
        output, errors = process.communicate(timeout=PATIENCE)
    except subprocess.TimeoutExpired:
        process.terminate()  # mpirun ends its ranks
        process.communicate()
        raise
    return subprocess.CompletedProcess(process.args, process.returncode, output, errors)
