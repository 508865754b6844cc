"""Measures the constants of memory in feti_homog/homogenization/partition_policy.py on one rank, and prints them.

    .venv/bin/python scripts/measure_cost.py

Each kind of cell is refined several times. The constants fit the logarithms of the estimates to the measurements, so
that twice as much is as wrong as half.
"""

import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w
from composite import STIFFNESS
from scipy.optimize import least_squares

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
MANY_FIBRES = (
    {"geometry": "random", "fibre_fraction": 0.45, "mesh_size": 0.05, "fibres": 100},
    {"geometry": "random", "fibre_fraction": 0.45, "mesh_size": 0.03, "fibres": 300},
)
REFINEMENTS, OF_COATED, OF_ONE_FACTOR, OF_MANY = (0, 1, 2, 3), (0, 1, 2), (2, 3), (0, 1, 2)
BODIES = {"cut": "bodies"}
DEBONDED = {"debonded": [{"fibre": [1], "centre": 0.0, "angle": 60.0}]}
ON_SPRINGS = DEBONDED | {"normal_stiffness": 1e3, "tangential_stiffness": 1e3}
GLASS = {"matrix": {"young": 3.0, "poisson": 0.35}, "fibre": {"young": 70.0, "poisson": 0.22}}
UNDAMAGED = {"debonded": [{"fibre": "all"}], "contact": False}
KEPT = {"analysis": {"type": "angle", "plane": "strain"}, "interface": UNDAMAGED, "angle": {"values": [0.0]}}
WITH_FIELDS = {"pictures": False}
COATING = {"young": 20.0, "poisson": 0.3}


def main() -> None:
    """Run the cases, with fields, each in a separate process, and fit."""
    runs = [document(cell, refine) for cell in CELLS for refine in REFINEMENTS]
    coated = [document(cell, refine) for cell in COATED for refine in OF_COATED]
    bonds = [{"interface": bond, "material": GLASS} for bond in (DEBONDED, ON_SPRINGS)]
    many = [document(cell, refine, {}, bond) for cell in MANY_FIBRES for refine in OF_MANY for bond in bonds]
    fits = memory_fit([*runs, *many], coated) | interior_fit(runs) | factor_fit()
    for names, (constants, ratios) in fits.items():
        for name, value in zip(names.split(", "), constants, strict=True):
            print(f"{name} = {value:.1e}")
        print(f"    estimates are {ratios.min():.2f} to {ratios.max():.2f} times the measurements")


def memory_fit(runs: list[dict[str, Any]], coated: list[dict[str, Any]]) -> dict[str, tuple[Any, Any]]:
    """Fit the memory of all runs by twice the mesh nodes, subdomains, springs and, in coated cells, influence columns.

    Returns, by the names of the constants in `partition_policy`, values and estimates / measurements.
    """
    every = [*runs, *coated]
    memory, dofs = np.array([(run["memory"], 2 * run["cell"]["nodes"]) for run in every]).T
    subdomains = np.array([run["solver"]["subdomains"] for run in every])
    on_springs = subdomains * ["normal_stiffness" in (run["case"].get("interface") or {}) for run in every]
    columns = np.array([*(0 for _ in runs), *(run["solver"]["multipliers"] for run in coated)])
    names = "BASE_BYTES, DOF_BYTES, SUBDOMAIN_BYTES, SPRING_BYTES, COLUMN_BYTES"
    return {names: fitted(memory, np.ones(len(memory)), dofs, subdomains, on_springs, columns)}


def interior_fit(runs: list[dict[str, Any]]) -> dict[str, tuple[Any, Any]]:
    """Fit the additional memory of the largest cells if the factors of interiors are kept, as for many angles."""
    large = [number for number in range(len(runs)) if number % len(REFINEMENTS) in OF_ONE_FACTOR]
    kept = [document(CELLS[n // len(REFINEMENTS)], REFINEMENTS[n % len(REFINEMENTS)], BODIES, KEPT) for n in large]
    memory, dofs = np.array([(run["memory"], 2 * run["cell"]["nodes"]) for run in kept]).T
    added = memory - np.array([runs[n]["memory"] for n in large])
    constant = np.median(added / dofs)
    return {"INTERIOR_BYTES": ([constant], constant * dofs / added)}


def factor_fit() -> dict[str, tuple[Any, Any]]:
    """Fit the memory of a cell of one factor, less the memory by the present other constants."""
    runs = [document(cell, refine, {}) for cell in CELLS for refine in OF_ONE_FACTOR]
    runs = [run for run in runs if run["solver"]["subdomains"] == 1]
    memory, dofs = np.array([(run["memory"], 2 * run["cell"]["nodes"]) for run in runs]).T
    from feti_homog.homogenization import partition_policy  # starts MPI, after which no run can be started

    others = partition_policy.BASE_BYTES + partition_policy.SUBDOMAIN_BYTES + partition_policy.DOF_BYTES * dofs
    constant = np.median((memory - others) / dofs)
    return {"FACTOR_BYTES": ([constant], (others + constant * dofs) / memory)}


def document(cell: dict[str, Any], refine: int, decomposition: Any = BODIES, more: Any = None) -> dict[str, Any]:
    """Return result.json of one run with these sections."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "case.toml"
        materials = STIFFNESS["material"] | ({"coating": COATING} if "coating" in cell else {})
        own = {"cell": cell | {"refine": refine}, "material": materials, "output": WITH_FIELDS}
        path.write_text(tomli_w.dumps(STIFFNESS | own | {"decomposition": decomposition} | (more or {})))
        words = ["-m", "feti_homog", "run", path, "--out", folder, "--quiet"]
        subprocess.run([sys.executable, *map(str, words)], check=True)
        return result_json.read(Path(folder))


def fitted(values: Any, *columns: Any) -> tuple[Any, Any]:
    """Return positive constants with values = sum of constant * column, nearly, and sum / values."""
    matrix = np.stack(columns, axis=1) / values[:, None]
    first = np.log(1.0 / np.array([np.median(column[column > 0]) for column in matrix.T]) / len(columns))
    constants = np.exp(least_squares(lambda logarithms: np.log(matrix @ np.exp(logarithms)), first).x)
    return constants, matrix @ constants


if __name__ == "__main__":
    main()
