"""Voids between fibres: stiffness and onset of debonding over the porosity, in random cells.

    mpirun -n 2 .venv/bin/python drivers/voids.py --out results/voids

Glass in epoxy in plane strain; the same fibre fraction with more and more voids half as large as the fibres. The table
compares the plane bulk and shear moduli with T. Mori and K. Tanaka (Y. Benveniste, Mech. Mater. 6, 1987, 147), for
fibres and voids in the matrix. Onset is the stress S11, applied alone, at which the first bond breaks.
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
FRACTION = 0.4
STRENGTHS = {"normal_strength": 0.05, "tangential_strength": 0.05}  # GPa
HEAD = ("porosity", "K", "K spread", "K Mori-Tanaka", "G", "G spread", "G Mori-Tanaka", "S11 onset", "S11 spread")


def main(given: argparse.Namespace, comm: Intracomm) -> None:
    """Solve all porosities; print, write and draw."""
    shares = [0.0, 0.05] if given.quick else [0.0, 0.01, 0.02, 0.04, 0.06, 0.08, 0.1]
    figures.finish(comm, write, given.out, [row(given, comm, share) for share in shares])


def row(given: argparse.Namespace, comm: Intracomm, share: float) -> list[float]:
    """Return the columns of one porosity: means over the cells, and their standard deviations."""
    found = []
    for seed in range(2 if given.quick else given.cells):
        bonded = solved(given, comm, share, seed, "stiffness")
        onset = solved(
            given,
            comm,
            share,
            seed,
            "envelope",
            interface=STRENGTHS,
            envelope={"plane": ["S11", "S22"], "directions": 4},
        )
        assert bonded.moduli is not None and onset.envelope is not None and onset.envelope[0].stress is not None
        found.append((bonded.cell.porosity, bonded.moduli.bulk, bonded.moduli.shear, onset.envelope[0].stress[0]))
    (porosity, bulk, shear, stress), (_, *spread) = np.mean(found, axis=0), np.std(found, axis=0, ddof=1)
    closed = mori_tanaka(porosity)
    return [porosity, bulk, spread[0], closed[0], shear, spread[1], closed[1], stress, spread[2]]


def solved(
    given: argparse.Namespace, comm: Intracomm, share: float, seed: int, analysis: str, **sections: Any
) -> Result:
    """Run an analysis of a cell in a separate folder, and return its result."""
    name = f"{analysis}-{share:g}-{seed}"
    document = {
        "name": name,
        "cell": {
            "geometry": "random", "fibres": given.fibres, "fibre_fraction": FRACTION, "seed": seed, "voids": share,
            "void_radius": 0.5, "mesh_size": 0.1 if given.quick else given.mesh_size, "order": 2,
        },
        "material": {"matrix": MATRIX, "fibre": FIBRE},
        "analysis": {"type": analysis, "plane": "strain"},
        "output": figures.written(given) | {"stress_unit": "GPa"},
        **sections,
    }  # fmt: skip
    return figures.computed(comm, Case.parse(document), given.out / name)


def mori_tanaka(porosity: float) -> tuple[float, float]:
    """Return the plane bulk and shear moduli, sum of c M A / sum of c A over matrix, fibres and voids.

    A = (M_0 + m) / (M + m) is the strain of a cylinder of modulus M in the matrix, with m = G_0 for K, and
    K_0 G_0 / (K_0 + 2 G_0) for G.
    """
    (bulk, shear), fibre = moduli(MATRIX), moduli(FIBRE)
    parts = np.array([1 - FRACTION - porosity, FRACTION, porosity])
    found = []
    for own, inside, about in ((bulk, fibre[0], shear), (shear, fibre[1], bulk * shear / (bulk + 2 * shear))):
        phases = np.array([own, inside, 0.0])
        strains = parts * (own + about) / (phases + about)
        found.append(float(phases @ strains / strains.sum()))
    return found[0], found[1]


def moduli(phase: dict[str, float]) -> tuple[float, float]:
    """Return the plane bulk modulus lambda + G, and G."""
    shear = phase["young"] / (2 * (1 + phase["poisson"]))
    return shear / (1 - 2 * phase["poisson"]), shear


def write(folder: Path, rows: list[list[float]]) -> list[Path]:
    """Write voids.csv and voids.png."""
    from matplotlib.figure import Figure

    print(f"fibre fraction {FRACTION:g}; GPa")
    print("".join(f"{name:>15}" for name in HEAD))
    for row in rows:
        print("".join(f"{value:15.5g}" for value in row))
    porosity, bulk, bulk_spread, bulk_closed, shear, shear_spread, shear_closed, onset, spread = np.array(rows).T
    table = figures.tabulate(folder / "voids.csv", HEAD, rows)
    figure = Figure(figsize=(9.2, 3.9), layout="constrained")
    left, right = figure.subplots(1, 2)
    for mean, error, closed, ink, name in (
        (bulk, bulk_spread, bulk_closed, INK[0], "K, plane bulk modulus"),
        (shear, shear_spread, shear_closed, INK[1], "G, shear modulus"),
    ):
        left.errorbar(100 * porosity, mean, error, fmt="o", color=ink, capsize=3, label=name)
        left.plot(100 * porosity, closed, color=ink, linewidth=1, label=f"{name[0]}, Mori and Tanaka")
    left.set(ylabel="stiffness (GPa)", ylim=(0, None))
    left.legend(frameon=False, fontsize=9)
    right.errorbar(100 * porosity, 1e3 * onset, 1e3 * spread, fmt="o-", color=INK[2], capsize=3)
    right.set(ylabel="$\\Sigma_{11}$ at onset of debonding (MPa)", ylim=(0, None))
    for axes in (left, right):
        axes.set(xlabel="porosity (%)")
    figure.savefig(folder / "voids.png")
    return [table, folder / "voids.png"]


if __name__ == "__main__":
    options = figures.quick_parser(__doc__ or "", "voids", "a coarse mesh, two porosities and two cells of each")
    options.add_argument("--cells", type=int, default=5, help="cells of each porosity")
    options.add_argument("--fibres", type=int, default=16, help="fibres of a cell")
    options.add_argument("--mesh-size", type=float, default=0.05, help="coarse element size / cell width")
    sys.exit(launch(main, options))
