"""Settings of a process, libraries that are optional, and the peak of resident memory, which begins anew."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from feti_homog.system.runtime import process

LARGE = 100 * 2**20  # bytes


def test_settings_and_threads_of_the_user_stay():
    variables = {"OMP_THREAD_LIMIT": "2"}
    process.prepare_environment(variables)
    assert variables == process.SETTINGS | process.ONE_HOST | process.ONE_RANK | {"OMP_THREAD_LIMIT": "2"}
    variables = {"OMP_NUM_THREADS": "4"}
    process.prepare_environment(variables)
    assert variables.pop("OMP_NUM_THREADS") == "4" and "OMP_THREAD_LIMIT" not in variables
    assert (process.SETTINGS | process.ONE_HOST | process.ONE_RANK).items() >= variables.items()


ALONE = process.ONE_HOST | process.ONE_RANK


@pytest.mark.parametrize(
    ("variables", "added"),
    [
        ({"SLURM_PROCID": "0"}, ALONE),  # of a batch script, which is no rank of `srun`
        ({"OMPI_COMM_WORLD_SIZE": "4", "OMPI_COMM_WORLD_LOCAL_SIZE": "4"}, process.ONE_HOST),
        ({"OMPI_COMM_WORLD_SIZE": "4", "OMPI_COMM_WORLD_LOCAL_SIZE": "2"}, {}),
        ({"PMIX_RANK": "0"}, {}),
        ({"PMI_RANK": "0"}, {}),
        ({"OMPI_MCA_btl": "tcp,self"}, process.ONE_RANK),
        ({"OMPI_MCA_mtl": "psm2"}, process.ONE_RANK),
    ],
)
def test_open_mpi_starts_without_networks_on_one_host_and_without_a_daemon_alone(variables, added):
    found = dict(variables)
    process.prepare_environment(found)
    assert found == variables | process.SETTINGS | added


def test_numpy_is_not_loaded_before_the_settings():
    program = "import sys, feti_homog.__main__; print('numpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", program], capture_output=True, text=True).stdout == "False\n"


# What Debian's matplotlib-nspkg.pth does at the start of Python.
BOUND_TO_ANOTHER = """
import sys, types
toolkits = types.ModuleType("mpl_toolkits")
toolkits.__path__ = [sys.argv[1]]
sys.modules["mpl_toolkits"] = toolkits
"""
PAIR = "from feti_homog.system.runtime.process import prefer_own_toolkits; prefer_own_toolkits()\n"
CHECK = """
assert 'matplotlib' not in sys.modules
from matplotlib import figure, projections
print('3d' in projections.get_projection_names())
"""


def words_of(tmp_path: Path, program: str) -> tuple[str, str]:
    """Return output and warnings of a program where the bound toolkits are those of an old Matplotlib."""
    old = tmp_path / "mpl_toolkits" / "mplot3d"
    old.mkdir(parents=True, exist_ok=True)
    (old / "__init__.py").write_text("from matplotlib import something_that_is_gone")
    run = subprocess.run([sys.executable, "-c", program, str(old.parent)], capture_output=True, text=True, check=True)
    return run.stdout, run.stderr


@pytest.mark.slow
def test_matplotlib_finds_its_own_toolkits(tmp_path: Path) -> None:
    _, warning = words_of(tmp_path, BOUND_TO_ANOTHER + CHECK)
    assert "Unable to import Axes3D" in warning
    shown, warning = words_of(tmp_path, BOUND_TO_ANOTHER + PAIR + CHECK)
    assert (warning, shown) == ("", "True\n")


@pytest.mark.slow
@pytest.mark.parametrize("start", ["api.start(lambda words, comm: 0, [])", "api._started(None).__enter__()"])
def test_every_start_of_the_program_pairs_them(tmp_path: Path, start: str) -> None:
    shown, warning = words_of(tmp_path, f"{BOUND_TO_ANOTHER}from feti_homog import api; {start}\n{CHECK}")
    assert shown == "True\n" and "Axes3D" not in warning


@pytest.mark.skipif(not os.access(process.CLEAR_REFS, os.W_OK), reason="the system does not let it")
def test_a_peak_is_forgotten():
    process.forget_peak()
    before = process.peak_memory()
    block = np.ones(LARGE // 8)
    assert process.peak_memory() > before + 0.9 * LARGE
    del block
    assert process.peak_memory() > before + 0.9 * LARGE
    process.forget_peak()
    assert process.peak_memory() < before + 0.5 * LARGE


def resident() -> int:
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def test_freed_bytes_stay_if_they_are_few():
    process.forget_peak()
    before = resident()
    blocks = [np.ones(10_000) for _ in range(LARGE // 80_000)]
    blocks = blocks[::100]  # between which the others are freed
    assert process.spare_memory() > 0.9 * LARGE
    process.forget_peak(kept=2**40)
    assert resident() > before + 0.8 * LARGE
    process.forget_peak()
    assert resident() < before + 0.5 * LARGE


def test_a_peak_that_cannot_be_forgotten_stays(tmp_path):
    before = process.peak_memory()
    process.forget_peak(tmp_path / "none" / "clear_refs")
    assert process.peak_memory() >= before
