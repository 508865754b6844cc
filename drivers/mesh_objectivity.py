"""Mesh dependence of a curve: bonds that break by strength beside bonds that break by energy, on four meshes.

    mpirun -n 2 .venv/bin/python drivers/mesh_objectivity.py --out results/mesh_objectivity

A square cell with one glass fibre of 7.5 um in epoxy, 40 %, plane strain, E11 alone.  By strength: rigid bonds of 90
MPa.  By energy: springs of 2025 and 506.25 MPa/um and a toughness of 2 J/m2, which is the same strength in pure
opening.  Where debonding has begun, bonds break by the energy of their own springs ("springs"), or by the energy that
their break releases ("released").  The curves are responses to a rising strain.  Strains are multiples of the onset
strain, 0.01175333 with springs.
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

MATERIAL = {"matrix": {"young": 2790.0, "poisson": 0.33}, "fibre": {"young": 70800.0, "poisson": 0.22}}  # MPa
RADIUS, FRACTION = 7.5, 0.4  # um
STRENGTH = 90.0  # MPa
ONSET = 0.01175333
SPRINGS = {"normal_stiffness": 2025.0, "tangential_stiffness": 506.25}
ENERGY = SPRINGS | {"criterion": "energy", "toughness": 2.0}
BONDS: dict[str, dict[str, Any]] = {
    "strength": {"normal_strength": STRENGTH, "tangential_strength": STRENGTH},
    "springs": ENERGY | {"growth": "springs"},
    "released": ENERGY | {"growth": "released"},
}
TITLES = {
    "strength": "by strength",
    "springs": "by the energy of springs",
    "released": "by the energy that is released",
}
REFINEMENTS = [1, 2, 3, 4]
COARSE = 0.16  # of the width: 14 elements on the interface
AT = [1.05, 1.2, 1.5, 2.0, 3.0]
COLUMNS = ("bonds", "element um", "onset S11", *(f"S11 at {t:g}" for t in AT), "debonded at 3")


def main(given: argparse.Namespace, comm: Intracomm) -> None:
    """Follow the path of each law on each mesh; print, write and draw."""
    refinements = REFINEMENTS[:2] if given.quick else REFINEMENTS
    found = {(bonds, refine): solved(given, comm, bonds, refine) for bonds in BONDS for refine in refinements}
    figures.finish(comm, write, given.out, found)


def solved(given: argparse.Namespace, comm: Intracomm, bonds: str, refine: int) -> Result:
    """Return the path of one law on one mesh."""
    document = {
        "name": f"{bonds}, refine = {refine}",
        "cell": {
            "geometry": "square",
            "fibre_radius": RADIUS,
            "fibre_fraction": FRACTION,
            "mesh_size": COARSE,
            "refine": refine,
        },
        "material": MATERIAL,
        "analysis": {"type": "path", "plane": "strain"},
        "interface": BONDS[bonds],
        "path": {"strain": [AT[-1] * ONSET, 0.0, 0.0]},
        "output": figures.written(given) | {"stress_unit": "MPa", "length_unit": "um"},
    }
    return figures.computed(comm, Case.parse(document), given.out / f"{bonds}_{refine}")


def element(result: Result) -> float:
    """Return the length of the elements on the interface, um."""
    first = (result.path or ())[0]
    return 2 * np.pi * RADIUS / (first.bonded + first.open + first.closed)


def numbers(result: Result) -> list[float]:
    """Return the stress at onset, the stresses at multiples of the onset strain, and the debonded share at the end."""
    points, rising = result.path or (), result.rising_strain()
    total = points[0].bonded + points[0].open + points[0].closed
    # Where the stress falls at constant strain, what is left.
    strain, stress = rising["E11"], rising["S11"]
    last = [np.flatnonzero(strain <= t * ONSET)[-1] for t in AT[:-1]]
    after = [
        stress[k] + (t * ONSET - strain[k]) * (stress[k + 1] - stress[k]) / (strain[k + 1] - strain[k])
        for k, t in zip(last, AT[:-1], strict=True)
    ]
    return [points[0].stress[0], *after, stress[-1], 1.0 - points[-1].bonded / total]


def write(folder: Path, found: dict[tuple[str, int], Result]) -> list[Path]:
    """Write mesh_objectivity.csv and mesh_objectivity.png."""
    from matplotlib.figure import Figure

    print("bonds     element um  onset S11 " + "".join(f"{f'at {t:g}':>9}" for t in AT) + "  debonded at 3")
    rows = []
    figure = Figure(figsize=(12.0, 4.2), layout="constrained")
    grid = dict(zip(BONDS, figure.subplots(1, 3, sharex=True, sharey=True), strict=True))
    for (bonds, refine), result in found.items():
        own, size = numbers(result), element(result)
        print(
            f"{bonds:<10}{size:>9.3f}{own[0]:>11.3f} " + "".join(f"{x:>9.2f}" for x in own[1:-1]) + f"{own[-1]:>12.1%}"
        )
        rows.append([bonds, size, *own])
        rising = result.rising_strain()
        ink = INK[(refine - REFINEMENTS[0]) % len(INK)]
        grid[bonds].plot(rising["E11"] / ONSET, rising["S11"], color=ink, linewidth=1.2, label=f"{size:.2f} um")
    for bonds, axes in grid.items():
        axes.set(xlabel="$E_{11}$ / strain of onset", title=TITLES[bonds])
        axes.grid(color="0.92", linewidth=0.6)
        axes.set_ylim(bottom=0.0)
    grid["strength"].set_ylabel("$\\Sigma_{11}$ (MPa)")
    grid["strength"].legend(title="elements on the interface", frameon=False, fontsize=9)
    figure.suptitle(
        "One fibre that debonds, on four meshes" if len(found) > 6 else "One fibre that debonds", fontsize=11
    )
    figure.savefig(folder / "mesh_objectivity.png")
    return [figures.tabulate(folder / "mesh_objectivity.csv", COLUMNS, rows), folder / "mesh_objectivity.png"]


if __name__ == "__main__":
    options = figures.quick_parser(__doc__ or "", "mesh_objectivity", "two meshes")
    sys.exit(launch(main, options))
