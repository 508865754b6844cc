"""The rules of the house: imports point to earlier rooms, importing starts nothing, files are short."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "feti_homog"
FOLDERS = ("feti_homog", "drivers", "scripts", "tests")
LONGEST = 400

# Each line may import from itself and from the lines above it.
ROOMS = (
    ("errors",),
    ("schema", "sections", "material", "bonding", "case"),
    ("bounds",),
    ("parallel", "heap"),
    ("options", "petsc_c", "petsc_options", "progress"),
    ("cell",),
    ("fem",),
    ("feti",),
    ("interface",),
    ("cost",),
    ("cutting",),
    ("torn", "homogenization"),
    ("output",),
    ("analysis",),
    ("result",),
    ("job",),
    ("start",),
    ("sweep",),
    ("cli",),
    ("__main__",),
)
LEVEL = {room: level for level, rooms in enumerate(ROOMS) for room in rooms}
MODULES = sorted(PACKAGE.rglob("*.py"))


def room(path: Path) -> str:
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def imported_rooms(path: Path) -> set[str]:
    """Rooms that a module imports from, wherever in it."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import in line {node.lineno}"
            names = [f"{node.module}.{alias.name}" for alias in node.names]
        else:
            continue
        parts = [name.split(".") for name in names]
        found |= {words[1] for words in parts if words[0] == "feti_homog" and len(words) > 1}
    return found & LEVEL.keys()


def test_every_module_has_its_room():
    assert {room(path) for path in MODULES} - {"__init__"} <= LEVEL.keys()


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_imports_point_to_earlier_rooms(path):
    own = room(path)
    later = {name for name in imported_rooms(path) if own != "__init__" and LEVEL[name] > LEVEL[own]}
    assert not later, f"{path.name} imports {', '.join(sorted(later))}"


def test_importing_starts_nothing():
    program = "import sys, feti_homog, feti_homog.case, feti_homog.cli; print(*sys.modules)"
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert not {"petsc4py", "mpi4py", "gmsh", "h5py", "matplotlib"} & set(run.stdout.split())


def test_only_a_rank_that_draws_loads_matplotlib():
    program = "import sys, feti_homog.job, feti_homog.sweep.execute; print(*sys.modules)"
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert "matplotlib" not in run.stdout.split()


def test_files_are_short():
    files = [path for folder in FOLDERS for path in (ROOT / folder).rglob("*.py")]
    lengths = {path: len(path.read_text(encoding="utf-8").splitlines()) for path in files}
    assert not {str(path): n for path, n in lengths.items() if n > LONGEST}


@pytest.mark.parametrize("script", ["benchmark", "benchmark_sweep", "measure_cost", "scaling"])
def test_scripts_that_start_jobs_do_not_start_mpi(script):
    """mpirun would refuse to start from a program that MPI runs in."""
    code = f"import sys; sys.path.insert(0, 'scripts'); import {script}; sys.exit('mpi4py.MPI' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=False).returncode == 0
