"""What the tests share: assertions that all ranks agree on, and runs under mpirun."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parent.parent
LAUNCHER_VARIABLES = ("OMPI_", "PMIX_", "ORTE_", "PMI_")
RUN_VARIABLES = {
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
    "OMPI_MCA_btl_vader_single_copy_mechanism": "none",
    "OMP_NUM_THREADS": "1",
    "H5PY_ALWAYS_USE_MPI": "1",
}


def parallel_assert(comm: Any, condition: bool, message: str = "") -> None:
    """Fails on every rank if the condition is false on any. Collective."""
    failing = [rank for rank, holds in enumerate(comm.allgather(bool(condition))) if not holds]
    assert not failing, f"{message} (on ranks {failing})"


def mpirun(
    ranks: int, *args: str | Path, timeout: float = 120.0, cwd: Path = ROOT
) -> subprocess.CompletedProcess[str]:
    """`python args...` on so many ranks, with its output as text; ranks = 0 starts it without mpirun.

    Raises subprocess.TimeoutExpired if it takes longer than `timeout` seconds; nothing is left running.
    """
    launcher = ["mpirun", "--oversubscribe", "-n", str(ranks)] if ranks else []
    inherited = {k: v for k, v in os.environ.items() if not k.startswith(LAUNCHER_VARIABLES)}
    process = subprocess.Popen(
        [*launcher, sys.executable, *map(str, args)],
        cwd=cwd, env=inherited | RUN_VARIABLES, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip
    try:
        output, errors = process.communicate(timeout=timeout)
    except subprocess.TimeoutExpired:
        process.terminate()  # mpirun ends its ranks
        process.communicate()
        raise
    return subprocess.CompletedProcess(process.args, process.returncode, output, errors)
