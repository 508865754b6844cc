"""Settings of a process, and libraries that are optional."""

import subprocess
import sys
from pathlib import Path

import pytest

from feti_homog.system.runtime import environment


def test_settings_and_threads_of_the_user_stay():
    variables = {"OMP_THREAD_LIMIT": "2"}
    environment.prepare(variables)
    assert variables == environment.SETTINGS | {"OMP_THREAD_LIMIT": "2"}
    variables = {"OMP_NUM_THREADS": "4"}
    environment.prepare(variables)
    assert variables.pop("OMP_NUM_THREADS") == "4" and "OMP_THREAD_LIMIT" not in variables
    assert environment.SETTINGS.items() >= variables.items()


def test_numpy_is_not_loaded_before_the_settings():
    import subprocess

    program = "import sys, feti_homog.__main__; print('numpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", program], capture_output=True, text=True).stdout == "False\n"


# What Debian's matplotlib-nspkg.pth does at the start of Python.
BOUND_TO_ANOTHER = """
import sys, types
toolkits = types.ModuleType("mpl_toolkits")
toolkits.__path__ = [sys.argv[1]]
sys.modules["mpl_toolkits"] = toolkits
"""
PAIR = "from feti_homog.system.runtime.environment import prefer_own_toolkits; prefer_own_toolkits()\n"
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
