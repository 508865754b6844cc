"""Fit the transverse and shear moduli of a carbon fibre, which no fibre test gives, to ply constants.

    mpirun -n 2 .venv/bin/python drivers/carbon_fibre.py --out results/carbon_fibre

Plies of AS4/3501-6 at three fibre fractions: the constants at 0.6 come from the exact solution of the hexagonal
arrangement, the others from finer cells.  The constants of the epoxy and of the fibre along its axis are given; the fit
returns E_transverse, nu_transverse and G_axial with their intervals, beside the true constants of the plies.
"""

import argparse
import sys
from pathlib import Path
from typing import Any

from mpi4py.MPI import Intracomm

from feti_homog import Case, launch, run, run_fit

EPOXY = {"young": 4.8, "poisson": 0.34}  # GPa
ALONG = {"E_axial": 235.0, "nu_axial": 0.2}
ACROSS = {"E_transverse": 14.0, "nu_transverse": 0.25, "G_axial": 28.0}
UNKNOWN = {
    "E_transverse": {"start": 25.0, "lower": 5.0, "upper": 100.0},
    "nu_transverse": {"start": 0.35, "lower": 0.0, "upper": 0.49},
    "G_axial": {"start": 15.0, "lower": 3.0, "upper": 100.0},
}
MEASURED, FRACTIONS, STD = ("E_transverse", "G_transverse", "G_axial"), (0.5, 0.55, 0.6), 0.01
EXACT = {0.6: (9.1812952, 3.3297852, 5.8190872)}  # by multipole series


def main(given: argparse.Namespace, comm: Intracomm) -> None:
    """Make the plies, fit, and print the estimates beside the true constants."""
    plies = {fraction: EXACT.get(fraction) or ply(given, comm, fraction) for fraction in FRACTIONS}
    fitted = document(given, ALONG) | {
        "name": "carbon fibre",
        "unknown": {f"material.fibre.{name}": own for name, own in UNKNOWN.items()},
        "test": [
            {"cell": {"fibre_fraction": fraction}, "measured": measured(values)} for fraction, values in plies.items()
        ],
    }
    found = run_fit(fitted, given.out, comm, quiet=False)
    if comm.rank == 0:
        print(f"\n{'':<16}{'plies made of':>14}{'estimate':>12}{'error':>12}")
        for name, value in ACROSS.items():
            estimate = found["unknowns"][f"material.fibre.{name}"]["estimate"]
            print(f"{name:<16}{value:>14g}{estimate:>12.6g}{estimate / value - 1:>12.1e}")


def document(given: argparse.Namespace, fibre: dict[str, float], finer: int = 0) -> dict[str, Any]:
    """Return the case of a ply without its fraction."""
    mesh_size = 0.3 if given.quick else given.mesh_size
    return {
        "cell": {"geometry": "hexagonal", "mesh_size": mesh_size, "refine": finer, "order": 2},
        "material": {"matrix": EPOXY, "fibre": fibre},
        "analysis": {"type": "stiffness", "plane": "generalized"},
        "output": {"stress_unit": "GPa"},
    }


def ply(given: argparse.Namespace, comm: Intracomm, fraction: float) -> tuple[float, ...]:
    """Return the constants of a finer cell."""
    case = document(given, ALONG | ACROSS, finer=1)
    case["cell"]["fibre_fraction"] = fraction
    constants = run(Case.parse(case), comm).transversely_isotropic
    return tuple(float(getattr(constants, name)) for name in MEASURED)


def measured(values: tuple[float, ...]) -> dict[str, Any]:
    """Return the measured values of a ply, with the scatter of good tests."""
    return {name: {"value": value, "std": STD * value} for name, value in zip(MEASURED, values, strict=True)}


def parser() -> argparse.ArgumentParser:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--out", type=Path, default=Path("results/carbon_fibre"), metavar="DIR")
    options.add_argument("--quick", action="store_true", help="coarse meshes, in place of --mesh-size")
    options.add_argument("--mesh-size", type=float, default=0.15)
    return options


if __name__ == "__main__":
    sys.exit(launch(main, parser()))
