"""Coated fibres: moduli over the coating's stiffness, and the first of two interfaces to debond.

    mpirun -n 2 .venv/bin/python drivers/coated_fibres.py --out results/coated_fibres

Glass in epoxy, hexagonal cell in plane strain.  The table compares the plane bulk modulus with composite cylinders (Z.
Hashin, B. W. Rosen, J. Appl. Mech. 31, 1964, 223): a cylinder of fibre and coating inside a matrix cylinder. It also
lists the stress S11, applied alone, at which each interface debonds; both interfaces have equal bonds.
"""

import argparse
import sys
from pathlib import Path
from typing import Any

import figures
import numpy as np
from figures import INK
from mpi4py.MPI import Intracomm

from feti_homog import Case, Result, launch

MATRIX, FIBRE = {"young": 3.0, "poisson": 0.35}, {"young": 70.0, "poisson": 0.22}  # GPa
COATING_POISSON = 0.35
FRACTION = 0.4
STRENGTHS = {"normal_strength": 0.05, "tangential_strength": 0.05}  # GPa
PAIRS = (("fibre", "coating"), ("coating", "matrix"))


def main(given: argparse.Namespace, comm: Intracomm) -> None:
    """Solve all coatings; print, write and draw."""
    ratios = np.geomspace(0.03, 30.0, 3 if given.quick else 13)
    rows = [[ratio, *point(given, comm, float(ratio))] for ratio in ratios]
    figures.finish(comm, write, given.out, given.coating, rows)


def point(given: argparse.Namespace, comm: Intracomm, ratio: float) -> list[float]:
    """Compute moduli and onsets for a coating whose stiffness is `ratio` times the matrix stiffness.

    Returns the bulk modulus, the bulk modulus of composite cylinders, the shear modulus, and S11 at the onset of
    debonding within and around the coating.
    """
    coating = {"young": ratio * MATRIX["young"], "poisson": COATING_POISSON}
    bonded = solved(given, comm, coating, "stiffness", "bonded")
    assert bonded.moduli is not None
    onsets = [
        solved(
            given,
            comm,
            coating,
            "envelope",
            pair[0],
            interface=[STRENGTHS | {"between": list(pair)}],
            envelope={"plane": ["S11", "S22"], "directions": 4},
        )
        for pair in PAIRS
    ]
    first = [float(onset.envelope[0].stress[0]) for onset in onsets if onset.envelope]
    return [bonded.moduli.bulk, composite_cylinders(coating, given.coating), bonded.moduli.shear, *first]


def solved(
    given: argparse.Namespace, comm: Intracomm, coating: dict[str, float], analysis: str, name: str, **sections: Any
) -> Result:
    """Run an analysis of the coated cell in the folder `name`, and return its result."""
    document = {
        "name": f"{name} {coating['young']:g}",
        "cell": {
            "geometry": "hexagonal", "fibre_fraction": FRACTION, "coating": given.coating,
            "mesh_size": 0.2 if given.quick else given.mesh_size, "order": 2,
        },
        "material": {"matrix": MATRIX, "fibre": FIBRE, "coating": coating},
        "analysis": {"type": analysis, "plane": "strain"},
        "output": figures.written(given) | {"stress_unit": "GPa"},
        **sections,
    }  # fmt: skip
    return figures.computed(comm, Case.parse(document), given.out / f"{name}-{coating['young']:.3g}")


def composite_cylinders(coating: dict[str, float], thickness: float) -> float:
    """Return the plane bulk modulus of nested cylinders of fibre, coating and matrix."""
    outer = FRACTION * (1 + thickness) ** 2
    coated = cylinder(coating, moduli(FIBRE)[0], FRACTION / outer)
    return cylinder(MATRIX, coated, outer)


def cylinder(around: dict[str, float], core: float, share: float) -> float:
    """Return k + c / [1/(K - k) + (1 - c)/(k + G)], the plane bulk modulus of a cylinder with a core K of share c."""
    bulk, shear = moduli(around)
    return bulk + share / (1 / (core - bulk) + (1 - share) / (bulk + shear))


def moduli(phase: dict[str, float]) -> tuple[float, float]:
    """Return the plane bulk modulus lambda + G, and G."""
    shear = phase["young"] / (2 * (1 + phase["poisson"]))
    return shear / (1 - 2 * phase["poisson"]), shear


def write(folder: Path, thickness: float, rows: list[list[float]]) -> list[Path]:
    """Write coated_fibres.csv and coated_fibres.png."""
    from matplotlib.figure import Figure

    head = ("E coating / E matrix", "K", "K cylinders", "G", "S11 fibre | coating", "S11 coating | matrix")
    print(f"coating of {thickness:g} radii; GPa")
    print("".join(f"{name:>21}" for name in head))
    for row in rows:
        print("".join(f"{value:21.5g}" for value in row))
    ratio, bulk, cylinders, shear, inner, outer = np.array(rows).T
    print(f"K / K cylinders: {(bulk / cylinders).min():.4f} to {(bulk / cylinders).max():.4f}")
    table = figures.tabulate(folder / "coated_fibres.csv", head, rows)
    figure = Figure(figsize=(9.2, 3.9), layout="constrained")
    left, right = figure.subplots(1, 2)
    left.plot(ratio, bulk, "o", color=INK[0], label="K, plane bulk modulus")
    left.plot(ratio, cylinders, color=INK[0], linewidth=1, label="K of composite cylinders")
    left.plot(ratio, shear, "s", color=INK[1], label="G, shear modulus")
    left.set(ylabel="stiffness (GPa)", ylim=(0, None))
    right.plot(ratio, 1e3 * inner, "o-", color=INK[2], label="fibre from coating")
    right.plot(ratio, 1e3 * outer, "s-", color=INK[3], label="coating from matrix")
    right.set(ylabel="$\\Sigma_{11}$ at onset (MPa)", ylim=(0, None))
    for axes in (left, right):
        axes.set(xscale="log", xlabel="E of the coating / E of the matrix")
        axes.legend(frameon=False, fontsize=9)
    figure.savefig(folder / "coated_fibres.png")
    return [table, folder / "coated_fibres.png"]


if __name__ == "__main__":
    options = figures.quick_parser(__doc__ or "", "coated_fibres", "a coarse mesh and three coatings")
    options.add_argument("--coating", type=float, default=0.1, help="thickness / radius")
    options.add_argument("--mesh-size", type=float, default=0.08, help="coarse element size / cell width")
    sys.exit(launch(main, options))
