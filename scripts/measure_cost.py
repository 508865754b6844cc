"""Measures the constants of feti_homog/homogenization/cost_model.py on this machine, on one rank, and prints them.

    .venv/bin/python scripts/measure_cost.py

Each kind of cell is refined several times; the constants make the logarithms of estimates and measurements agree best,
so that twice as much is as far off as half.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w
from composite import STIFFNESS
from scipy.optimize import least_squares

from feti_homog.homogenization import cost_model
from feti_homog.output.files import result_json

CELLS = (
    {"geometry": "hexagonal", "fibre_fraction": 0.4, "mesh_size": 0.05},
    {"geometry": "random", "fibre_fraction": 0.5, "mesh_size": 0.1, "fibres": 16},
    {"geometry": "random", "fibre_fraction": 0.5, "mesh_size": 0.05, "fibres": 64},
    {"geometry": "random", "fibre_fraction": 0.6, "mesh_size": 0.03, "fibres": 20, "min_gap": 0.04},
)
REFINEMENTS = (0, 1, 2, 3)
STAGES = ("mesh", "assemble", "factor", "solve")


def main() -> None:
    """Run the cases, each in a process of its own, and fit."""
    runs = [document(cell, refine) for cell in CELLS for refine in REFINEMENTS]
    for names, (constants, ratios) in fits(runs).items():
        for name, value in zip(names.split(", "), constants, strict=True):
            print(f"{name} = {value:.1e}")
        print(f"    estimates are {ratios.min():.2f} to {ratios.max():.2f} times what was measured")


def fits(runs: list[dict[str, Any]]) -> dict[str, tuple[Any, Any]]:
    """For the names of constants, as `cost_model` has them: their values, and estimates over measurements."""
    dofs, subdomains, iterations = (np.array([cost_of(run)[k] for run in runs]) for k in range(3))
    mesh, assemble, factor, solve = (np.array([run["timings"][name] for run in runs]) for name in STAGES)
    coarse = np.array([run["cell"]["elements"] / 4 ** run["case"]["cell"]["refine"] for run in runs])
    wall, memory = (np.array([run[name] for run in runs]) for name in ("wall", "memory"))
    one = np.ones(len(runs))
    return {
        "START_SECONDS": fitted(wall - mesh - assemble - factor - solve, one),
        "MESH_SECONDS": fitted(mesh, coarse),
        "SETUP_SECONDS, SUBDOMAIN_SECONDS": fitted(assemble + factor, dofs, subdomains),
        "APPLY_SECONDS": fitted(solve, dofs * iterations),
        "BASE_BYTES, DOF_BYTES": fitted(memory, one, dofs),
    }


def document(cell: dict[str, Any], refine: int) -> dict[str, Any]:
    """result.json of one run, and the seconds of its whole process as `wall`."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "case.toml"
        path.write_text(tomli_w.dumps({"cell": cell | {"refine": refine}} | STIFFNESS))
        words = ["-m", "feti_homog", "run", path, "--out", folder, "--quiet"]
        start = time.perf_counter()
        subprocess.run([sys.executable, *map(str, words)], check=True)
        return result_json.read(Path(folder)) | {"wall": time.perf_counter() - start}


def cost_of(run: dict[str, Any]) -> tuple[int, int, int]:
    """Degrees of freedom, subdomains, iterations."""
    solver = run["solver"]
    return solver["dofs"], solver["subdomains"], sum(solver["iterations"])


def fitted(values: Any, *columns: Any) -> tuple[Any, Any]:
    """Positive constants with values about the sum of constant * column, and that sum over the values."""
    matrix = np.stack(columns, axis=1) / values[:, None]
    first = np.log(1.0 / np.median(matrix, axis=0) / len(columns))
    constants = np.exp(least_squares(lambda logarithms: np.log(matrix @ np.exp(logarithms)), first).x)
    return constants, matrix @ constants


if __name__ == "__main__":
    main()
    print("now:", {name: value for name, value in vars(cost_model).items() if name.isupper()})
