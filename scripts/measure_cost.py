"""Measures the constants of feti_homog/cost.py on this machine, on one rank, and prints them.

    .venv/bin/python scripts/measure_cost.py

Each kind of cell is refined several times; the constants are least-squares fits without negative ones.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import nnls

from feti_homog import cost
from feti_homog.output import results

CASE = """\
[cell]
{cell}
refine = {refine}
[material.matrix]
young = 88.0
poisson = 0.299
[material.fibre]
young = 200.0
poisson = 0.222
[analysis]
type = "stiffness"
plane = "strain"
[output]
fields = false
pictures = false
"""
CELLS = (
    'geometry = "hexagonal"\nfibre_fraction = 0.4\nmesh_size = 0.05',
    'geometry = "random"\nfibre_fraction = 0.5\nmesh_size = 0.1\nfibres = 16',
    'geometry = "random"\nfibre_fraction = 0.5\nmesh_size = 0.05\nfibres = 64',
)
REFINEMENTS = (0, 1, 2, 3)


def main() -> None:
    """Run the cases, each in a process of its own, and fit."""
    runs = [document(cell, refine) for cell in CELLS for refine in REFINEMENTS]
    dofs, subdomains, iterations = (np.array([cost_of(run)[k] for run in runs]) for k in range(3))
    stages = ("mesh", "assemble", "factor", "solve")
    seconds = {name: np.array([run["timings"][name] for run in runs]) for name in stages}
    coarse = np.array([run["cell"]["elements"] / 4 ** run["case"]["cell"]["refine"] for run in runs])
    mesh = fitted(seconds["mesh"], coarse)
    setup = fitted(seconds["assemble"] + seconds["factor"], dofs, subdomains)
    apply = fitted(seconds["solve"], dofs * iterations)
    memory = fitted(np.array([run["memory"] for run in runs]), np.ones(len(runs)), dofs)
    print(f"MESH_SECONDS = {mesh[0]:.1e}\nSETUP_SECONDS = {setup[0]:.1e}\nSUBDOMAIN_SECONDS = {setup[1]:.1e}")
    print(f"APPLY_SECONDS = {apply[0]:.1e}\nBASE_BYTES = {memory[0]:.1e}\nDOF_BYTES = {memory[1]:.1e}")


def document(cell: str, refine: int) -> dict[str, Any]:
    """result.json of one run."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "case.toml"
        path.write_text(CASE.format(cell=cell, refine=refine))
        words = ["-m", "feti_homog", "run", path, "--out", folder, "--quiet"]
        subprocess.run([sys.executable, *map(str, words)], check=True)
        return results.read(Path(folder))


def cost_of(run: dict[str, Any]) -> tuple[int, int, int]:
    """Degrees of freedom, subdomains, iterations."""
    solver = run["solver"]
    return solver["dofs"], solver["subdomains"], sum(solver["iterations"])


def fitted(values: Any, *columns: Any) -> Any:
    """Constants with values = sum of constant * column, in relative terms, none negative."""
    return nnls(np.stack(columns, axis=1) / values[:, None], np.ones(len(values)))[0]


if __name__ == "__main__":
    main()
    print(f"now: {({name: value for name, value in vars(cost).items() if name.isupper()})}")
