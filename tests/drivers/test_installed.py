"""The package as others install it: a wheel in a fresh environment beside PETSc, without `scripts/environment`."""

import json
import os
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest
from support.jobs import LAUNCHER_VARIABLES, PATIENCE, ROOT, RUN_VARIABLES

from feti_homog.system.runtime.process import SETTINGS

SOURCES = ("feti_homog", "setup.py", "pyproject.toml", "README.md", "LICENSE")


def done(*words: str | Path, **options) -> str:
    job = subprocess.run([*map(str, words)], capture_output=True, text=True, timeout=PATIENCE, **options)
    assert job.returncode == 0, job.stdout + job.stderr
    return job.stdout


@pytest.fixture(scope="module")
def installed(tmp_path_factory) -> Path:
    """Provide the folder of an environment with the wheel.

    It finds its requirements where those of the tests are.
    """
    folder = tmp_path_factory.mktemp("installed")
    source = folder / "source"
    for name in SOURCES:
        copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy2
        source.mkdir(exist_ok=True)
        copy(ROOT / name, source / name)
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check"]
    done(*pip, "wheel", "--quiet", "--no-deps", "--no-build-isolation", "-w", folder, source)
    base = getattr(sys, "_base_executable", sys.executable)
    done(base, "-m", "venv", "--system-site-packages", "--without-pip", folder / "venv")
    paths = [path for path in sys.path if path.endswith(("site-packages", "dist-packages"))]
    assert sysconfig.get_path("purelib") in paths
    site = next((folder / "venv" / "lib").glob("python*/site-packages"))
    (site / "requirements.pth").write_text("\n".join(paths))
    wheel = next(folder.glob("*.whl"))
    done(*pip, "--python", folder / "venv/bin/python", "install", "--quiet", "--no-deps", "--no-index", wheel)
    return folder


def variables() -> dict[str, str]:
    """Return the environment of a user who has set what the launcher needs, and nothing else."""
    own = {
        k: v for k, v in os.environ.items() if not k.startswith((*LAUNCHER_VARIABLES, "PYTHON")) and k not in SETTINGS
    }
    return own | {k: v for k, v in RUN_VARIABLES.items() if k not in SETTINGS}


def test_the_wheel_runs_the_demo_case(installed, tmp_path):
    text = (ROOT / "drivers/hexagonal.toml").read_text(encoding="utf-8").replace("refine = 2", "refine = 0")
    (tmp_path / "case.toml").write_text(text.replace("[output]", "[output]\nreport = true"))
    words = [installed / "venv/bin/feti-homog", "run", "case.toml", "--out", "out"]
    done("mpirun", "--oversubscribe", "-n", "2", *words, cwd=tmp_path, env=variables())
    result = json.loads((tmp_path / "out" / "result.json").read_text())
    assert result["status"] == "done"
    assert result["effective_stiffness"][0][0] == pytest.approx(149.690255, rel=1e-3)  # drivers/README.md
    assert "<html" in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")


def test_the_wheel_is_what_runs(installed):
    program = "import feti_homog as package; print(package.__file__)"
    where = done(installed / "venv/bin/python", "-c", program, cwd=installed, env=variables())
    assert Path(where.strip()).is_relative_to(installed / "venv")
