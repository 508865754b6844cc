"""Fit toughness and strengths of an interface, which no interface test gives, to mean peaks of a ply.

    mpirun -n 2 .venv/bin/python drivers/interface_toughness.py --out results/interface_toughness

A glass/epoxy ply is loaded across its fibres in tension, which opens interfaces, and in compression, which shears them.
The mean peaks come from random cells whose bonds break by energy, on given springs, with a toughness of 2 J/m2 in
opening and a mode sensitivity of 0.25.  A fit of the same cells returns both constants; each datum has the scatter of
the mean times the root of the number of cells.  Peaks scale as the root of the toughness; derivatives by the
sensitivity are differences.  Strengths of single bonds follow: sqrt(2 k_n G_I), and in shear sqrt(2 k_t G_II).
"""

import argparse
import sys
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py.MPI import Intracomm

from feti_homog import Case, launch, run, run_fit

MATERIAL = {"matrix": {"young": 2790.0, "poisson": 0.33}, "fibre": {"young": 70800.0, "poisson": 0.22}}  # MPa
SPRINGS = {"criterion": "energy", "normal_stiffness": 2025.0, "tangential_stiffness": 506.25}  # MPa/um
TRUTH = {"toughness": 2.0, "mode_sensitivity": 0.25}
UNKNOWN = {
    "toughness": {"start": 2.6, "lower": 0.5, "upper": 10.0},
    "mode_sensitivity": {"start": 0.3, "lower": 0.05, "upper": 0.95},
}
LOADS = {"tension": 0.025, "compression": -0.09}  # E11 at the end, beside no other stress
STD = 0.02  # of a mean peak, relative


def main(given: argparse.Namespace, comm: Intracomm) -> None:
    """Compute mean peaks, fit, and print the estimates beside the true constants."""
    if given.quick:
        given.fibres, given.seeds, given.refine = 2, 1, 0
    tests: list[dict[str, Any]] = [
        {"cell": {"seed": seed}, "path": {"to": {"E11": strain, "S22": 0.0, "gamma12": 0.0}}}
        for seed in range(given.seeds)
        for strain in LOADS.values()
    ]
    peaks = np.array([peak(given, comm, test) for test in tests]).reshape(given.seeds, len(LOADS))
    for mean, test in zip(np.tile(peaks.mean(axis=0), given.seeds), tests, strict=True):
        test["measured"] = {"peak_S11": {"value": float(mean), "std": float(STD * abs(mean) * np.sqrt(given.seeds))}}
    names = ["toughness"] if given.quick else [*UNKNOWN]
    unknown = {f"interface.{name}": UNKNOWN[name] for name in names}
    known = {name: value for name, value in TRUTH.items() if name not in names}
    fitted = document(given, SPRINGS | known) | {"name": "interface", "unknown": unknown, "test": tests}
    found = run_fit(fitted, given.out, comm, quiet=False)
    if comm.rank == 0:
        report({name: found["unknowns"][f"interface.{name}"] for name in names}, known)


def report(found: dict[str, Any], known: dict[str, float]) -> None:
    """Print the estimates beside the true constants, and the strengths of single bonds."""
    print(f"\n{'':<20}{'plies made of':>14}{'estimate':>12}{'+-':>12}")
    for name, own in found.items():
        print(f"{name:<20}{TRUTH[name]:>14g}{own['estimate']:>12.6g}{own['std']:>12.2g}")
    estimates = known | {name: own["estimate"] for name, own in found.items()}
    labels = ("strength in opening", "strength in shear")
    for label, true, value in zip(labels, strengths(**TRUTH), strengths(**estimates), strict=True):
        print(f"{label:<20}{true:>14.6g}{value:>12.6g}")


def document(given: argparse.Namespace, interface: dict[str, Any]) -> dict[str, Any]:
    """Return the case of a ply without its seed and load."""
    return {
        "cell": {
            "geometry": "random",
            "fibres": given.fibres,
            "fibre_radius": 7.5,
            "fibre_fraction": 0.5,
            "min_gap": 0.06,
            "mesh_size": 3.3 / 7.5 * np.sqrt(0.5 / np.pi / given.fibres),
            "refine": given.refine,
        },
        "material": MATERIAL,
        "analysis": {"type": "path", "plane": "strain"},
        "interface": interface,
        "path": {},
        "output": {"stress_unit": "MPa", "length_unit": "um"},
    }


def peak(given: argparse.Namespace, comm: Intracomm, test: dict[str, Any]) -> float:
    """Return the peak of a cell with the true constants."""
    case = document(given, SPRINGS | TRUTH)
    found = run(Case.parse(case | {"cell": case["cell"] | test["cell"], "path": test["path"]}), comm).peak
    assert found is not None
    return float(found.stress)


def strengths(toughness: float, mode_sensitivity: float) -> tuple[float, float]:
    """Return the tractions at which single bonds break in opening and in shear."""
    in_shear = toughness * (1.0 + np.tan((1.0 - mode_sensitivity) * np.pi / 2) ** 2)
    pairs = (SPRINGS["normal_stiffness"], toughness), (SPRINGS["tangential_stiffness"], in_shear)
    first, second = (float(np.sqrt(2.0 * float(k) * energy)) for k, energy in pairs)
    return first, second


def parser() -> argparse.ArgumentParser:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--out", type=Path, default=Path("results/interface_toughness"), metavar="DIR")
    options.add_argument(
        "--quick", action="store_true", help="one cell of two fibres, the toughness alone, in place of other options"
    )
    options.add_argument("--seeds", type=int, default=4, help="arrangements: 0, 1, ...")
    options.add_argument("--fibres", type=int, default=20)
    options.add_argument("--refine", type=int, default=1)
    return options


if __name__ == "__main__":
    sys.exit(launch(main, parser()))
