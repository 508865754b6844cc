"""Measures the constants of feti_homog/homogenization/cost_model.py on this machine, on one rank, and prints them.

    .venv/bin/python scripts/measure_cost.py

Each kind of cell is refined several times; the constants make the logarithms of estimates and measurements agree best,
so that twice as much is as far off as half.  Times are those of the processor, so that other programs disturb little:
the stages have the shares of the whole that they have in wall time.
"""

from __future__ import annotations

import resource
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
from feti_homog.results import result_json

CELLS = (
    {"geometry": "hexagonal", "fibre_fraction": 0.4, "mesh_size": 0.05},
    {"geometry": "random", "fibre_fraction": 0.5, "mesh_size": 0.1, "fibres": 16},
    {"geometry": "random", "fibre_fraction": 0.5, "mesh_size": 0.05, "fibres": 64},
    {"geometry": "random", "fibre_fraction": 0.6, "mesh_size": 0.03, "fibres": 20, "min_gap": 0.04},
)
COATED = (
    {"geometry": "hexagonal", "fibre_fraction": 0.4, "mesh_size": 0.1, "coating": 0.05},
    {"geometry": "random", "fibre_fraction": 0.5, "mesh_size": 0.1, "fibres": 10, "coating": 0.05},
    {"geometry": "random", "fibre_fraction": 0.5, "mesh_size": 0.05, "fibres": 30, "coating": 0.1},
)
REFINEMENTS, OF_COATED, OF_ONE_FACTOR = (0, 1, 2, 3), (0, 1, 2), (2, 3)
BODIES = {"cut": "bodies"}
WITHOUT_FIELDS, WITH_FIELDS = STIFFNESS["output"] | {"mesh_error": False}, {"pictures": False}
WITH_ERRORS = STIFFNESS["output"]
COATING = {"young": 20.0, "poisson": 0.3}
STAGES = ("mesh", "assemble", "factor", "solve")


def main() -> None:
    """Run the cases, each in a process of its own, and fit: times without fields, memory with them."""
    runs = [document(cell, refine) for cell in CELLS for refine in REFINEMENTS]
    estimated = [document(cell, refine, WITH_ERRORS) for cell in CELLS for refine in REFINEMENTS]
    written = [document(cell, refine, WITH_FIELDS) for cell in CELLS for refine in REFINEMENTS]
    coated = [document(cell, refine, WITH_FIELDS) for cell in COATED for refine in OF_COATED]
    found = fits(runs) | error_fit(runs, estimated) | memory_fit(written, coated) | factor_fit()
    for names, (constants, ratios) in found.items():
        for name, value in zip(names.split(", "), constants, strict=True):
            print(f"{name} = {value:.1e}")
        print(f"    estimates are {ratios.min():.2f} to {ratios.max():.2f} times what was measured")


def fits(runs: list[dict[str, Any]]) -> dict[str, tuple[Any, Any]]:
    """For the names of constants, as `cost_model` has them: their values, and estimates over measurements."""
    dofs, subdomains, iterations = (np.array([cost_of(run)[k] for run in runs]) for k in range(3))
    mesh, assemble, factor, solve = (np.array([run["timings"][name] for run in runs]) for name in STAGES)
    coarse = np.array([run["cell"]["elements"] / 4 ** run["case"]["cell"]["refine"] for run in runs])
    whole = np.array([run["whole"] for run in runs])
    one = np.ones(len(runs))
    return {
        "START_SECONDS": fitted(whole - mesh - assemble - factor - solve, one),
        "MESH_SECONDS": fitted(mesh, coarse),
        "SETUP_SECONDS, SUBDOMAIN_SECONDS": fitted(assemble + factor, dofs, subdomains),
        "APPLY_SECONDS": fitted(solve, dofs * iterations),
    }


def error_fit(runs: list[dict[str, Any]], estimated: list[dict[str, Any]]) -> dict[str, tuple[Any, Any]]:
    """Return the same for the time of estimates, by which the same solves take longer."""
    more = np.array([b["timings"]["solve"] - a["timings"]["solve"] for a, b in zip(runs, estimated, strict=True)])
    dofs = np.array([cost_of(run)[0] for run in runs])
    return {"ERROR_SECONDS": fitted(more[more > 0], dofs[more > 0])}


def memory_fit(runs: list[dict[str, Any]], coated: list[dict[str, Any]]) -> dict[str, tuple[Any, Any]]:
    """Return the same for the memory of all runs, by twice the nodes of their meshes.

    Those with coatings have influence columns.
    """
    memory, dofs = np.array([(run["memory"], 2 * run["cell"]["nodes"]) for run in [*runs, *coated]]).T
    columns = np.array([*(0 for _ in runs), *(run["solver"]["multipliers"] for run in coated)])
    return {"BASE_BYTES, DOF_BYTES, COLUMN_BYTES": fitted(memory, np.ones(len(memory)), dofs, columns)}


def factor_fit() -> dict[str, tuple[Any, Any]]:
    """Fit the memory that a cell of one factor takes beyond the other constants of `cost_model`."""
    runs = [document(cell, refine, WITH_FIELDS, {}) for cell in CELLS for refine in OF_ONE_FACTOR]
    runs = [run for run in runs if run["solver"]["subdomains"] == 1]
    memory, dofs = np.array([(run["memory"], 2 * run["cell"]["nodes"]) for run in runs]).T
    others = cost_model.BASE_BYTES + cost_model.DOF_BYTES * dofs
    constant = np.median((memory - others) / dofs)
    return {"FACTOR_BYTES": ([constant], (others + constant * dofs) / memory)}


def document(
    cell: dict[str, Any], refine: int, output: Any = WITHOUT_FIELDS, decomposition: Any = BODIES
) -> dict[str, Any]:
    """result.json of one run with these sections; times, and `whole`, in seconds of the processor."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "case.toml"
        materials = STIFFNESS["material"] | ({"coating": COATING} if "coating" in cell else {})
        own = {"cell": cell | {"refine": refine}, "material": materials, "output": output}
        path.write_text(tomli_w.dumps(STIFFNESS | own | {"decomposition": decomposition}))
        words = ["-m", "feti_homog", "run", path, "--out", folder, "--quiet"]
        start, used = time.perf_counter(), processor_seconds()
        subprocess.run([sys.executable, *map(str, words)], check=True)
        whole, found = processor_seconds() - used, result_json.read(Path(folder))
        share = whole / (time.perf_counter() - start)
        timings = {stage: seconds * share for stage, seconds in found["timings"].items()}
        return found | {"timings": timings, "whole": whole}


def processor_seconds() -> float:
    """Return those of the processes that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def cost_of(run: dict[str, Any]) -> tuple[int, int, int]:
    """Degrees of freedom, subdomains, iterations."""
    solver = run["solver"]
    return solver["dofs"], solver["subdomains"], sum(solver["iterations"])


def fitted(values: Any, *columns: Any) -> tuple[Any, Any]:
    """Positive constants with values about the sum of constant * column, and that sum over the values."""
    matrix = np.stack(columns, axis=1) / values[:, None]
    first = np.log(1.0 / np.array([np.median(column[column > 0]) for column in matrix.T]) / len(columns))
    constants = np.exp(least_squares(lambda logarithms: np.log(matrix @ np.exp(logarithms)), first).x)
    return constants, matrix @ constants


if __name__ == "__main__":
    main()
    print("now:", {name: value for name, value in vars(cost_model).items() if name.isupper()})
