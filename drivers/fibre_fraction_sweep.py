"""Effective stiffness over the fibre fraction: square, hexagonal and random cells, in plane strain, with bounds.

    mpirun -n 2 .venv/bin/python drivers/fibre_fraction_sweep.py --out results/fibre_fraction_sweep

Fibres with E = 200, nu = 0.222 in a matrix with E = 88, nu = 0.299 (GPa), perfectly bonded.  Each random point is the
mean of several arrangements.  The driver is a sweep: started again, it continues.  It writes statistics.csv and
moduli.png.
"""

import argparse
import sys
from typing import Any

import numpy as np
import sweeping
from mpi4py.MPI import Intracomm

from feti_homog import launch

HEADS = f"{'cell':<11}{'fraction':>8}{'C11':>11}{'C12':>11}{'C33':>11}{'isotropy':>11}{'+- C11':>10}{'+- C33':>10}"


def main(given: argparse.Namespace, comm: Intracomm) -> None:
    """Run the sweep, print its points and draw them."""
    sweeping.swept(given, comm, document(given), report)


def document(given: argparse.Namespace) -> dict[str, Any]:
    """Return the sweep as a TOML file would have it."""
    cell = {"refine": given.refine, "order": given.order, "mesh_size": given.mesh_size}
    random = {"geometry": "random", "fibres": given.fibres}
    return {
        "name": "fibre fraction",
        "cell": cell,
        **sweeping.STIFFNESS,
        "sweep": {
            "realisations": given.realisations,
            "cell": [{"geometry": "square"}, {"geometry": "hexagonal"}, random],
            "cell.fibre_fraction": given.fractions,
        },
    }


def report(table: Any) -> list[str]:
    """Return a line for each point.

    Isotropy is |C33 - (C11 - C12)/2| / C33, +- the 95 % confidence interval of a mean.
    """
    lines = [f"stiffness in {table.stress_unit}", HEADS]
    for number, point in enumerate(table.points):
        row = table.rows(point)[0]
        C11, C12, C33 = (table.statistics[name].mean[number] for name in ("C11", "C12", "C33"))
        spread = [table.statistics[name].ci95[number] for name in ("C11", "C33")]
        spreads = "".join(f"{'' if np.isnan(value) else format(value, '.4f'):>10}" for value in spread)
        isotropy = abs(C33 - (C11 - C12) / 2) / C33
        geometry, fraction = (table.inputs[f"cell.{key}"][row] for key in ("geometry", "fibre_fraction"))
        lines.append(f"{geometry:<11}{fraction:>8g}{C11:>11.5f}{C12:>11.5f}{C33:>11.5f}{isotropy:>11.1e}{spreads}")
    return lines


def _parser() -> argparse.ArgumentParser:
    options = sweeping.parser(__doc__ or "", "fibre_fraction_sweep")
    options.add_argument("--fractions", type=float, nargs="+", default=[0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.65])
    options.add_argument("--fibres", type=int, default=30, help="of the random cells")
    options.add_argument("--realisations", type=int, default=5, help="arrangements of each random cell")
    options.add_argument("--mesh-size", type=float, default=0.1, help="coarse element size / cell width")
    return options


if __name__ == "__main__":
    sys.exit(launch(main, _parser()))
