"""Transverse strength of a glass/epoxy ply and its scatter: cells of random fibres that debond by energy.

    mpirun -n 2 .venv/bin/python drivers/transverse_strength.py --out results/transverse_strength

Each seed is another arrangement of 50 fibres of 7.5 um, 50 %, plane strain, strained along 1 alone.  Springs have 2025
and 506.25 MPa/um, toughness 2 J/m2.  Where debonding has begun, bonds break by the released energy, so elements of 0.8
um on the interface are fine enough.  `--law bilinear` has springs of 1e4 MPa/um instead, strengths of 50 and 70.71 MPa
in opening and shear and toughnesses of 2 and 4 J/m2, with a process zone of three such elements; the first break is
then the first tooth.  The matrix stays elastic, so debonding determines the peak.
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
INTERFACES: dict[str, dict[str, Any]] = {
    "energy": {
        "normal_stiffness": 2025.0,
        "tangential_stiffness": 506.25,
        "criterion": "energy",
        "toughness": 2.0,
    },
    "bilinear": {
        "normal_stiffness": 1e4,
        "tangential_stiffness": 1e4,
        "law": "bilinear",
        "normal_strength": 50.0,
        "tangential_strength": 50.0 * np.sqrt(2.0),
        "normal_toughness": 2.0,
        "tangential_toughness": 4.0,
    },
}
RADIUS = 7.5  # um
COLUMNS = ("seed", "C11", "first break S11", "peak S11", "E11 at peak", "points")


def main(given: argparse.Namespace, comm: Intracomm) -> None:
    """Follow the path of each seed; print, write and draw."""
    if given.quick:
        given.seeds, given.fibres, given.refine, given.teeth = 2, 4, 0, 2
    found = {seed: solved(given, comm, seed) for seed in range(given.seeds)}
    figures.finish(comm, write, given.out, found)


def solved(given: argparse.Namespace, comm: Intracomm, seed: int) -> Result:
    """Return the path of one arrangement."""
    teeth = {"teeth": given.teeth} if given.law == "bilinear" else {}
    document = {
        "name": f"seed {seed}",
        "cell": {
            "geometry": "random",
            "fibres": given.fibres,
            "fibre_radius": RADIUS,
            "fibre_fraction": given.fibre_fraction,
            "min_gap": 0.06,
            "seed": seed,
            # Elements of 0.8 um on the interface after refinement.
            "mesh_size": 3.3 / RADIUS * np.sqrt(given.fibre_fraction / np.pi / given.fibres),
            "refine": given.refine,
        },
        "material": MATERIAL,
        "analysis": {"type": "path", "plane": "strain"},
        "interface": INTERFACES[given.law] | teeth,
        "path": {"strain": [given.strain, 0.0, 0.0]},
        "output": figures.written(given) | {"stress_unit": "MPa", "length_unit": "um"},
    }
    return figures.computed(comm, Case.parse(document), given.out / f"seed_{seed}")


def row(result: Result) -> list[float]:
    """Return C11, stress of the first break, peak under rising strain, strain at the peak, and number of points."""
    points, peak = result.path or (), result.peak
    assert peak is not None
    first = points[0]
    return [first.stress[0] / first.strain[0], first.stress[0], peak.stress, peak.strain, len(points)]


def write(folder: Path, found: dict[int, Result]) -> list[Path]:
    """Write transverse_strength.csv and transverse_strength.png."""
    from matplotlib.figure import Figure

    rows = [[seed, *row(result)] for seed, result in found.items()]
    print("seed   C11 MPa  first break MPa  peak MPa   at E11  points")
    for seed, modulus, first, peak, strain, points in rows:
        print(f"{seed:>4}{modulus:>10.0f}{first:>17.2f}{peak:>10.2f}{strain:>9.5f}{points:>8}")
    peaks = np.array([r[3] for r in rows])
    mean, scatter = peaks.mean(), peaks.std(ddof=1) if len(peaks) > 1 else 0.0
    print(f"peak: {mean:.2f} MPa on average, standard deviation {scatter:.2f} MPa ({100 * scatter / mean:.1f} %)")
    figure = Figure(figsize=(6.6, 4.4), layout="constrained")
    axes = figure.subplots()
    for k, result in enumerate(found.values()):
        rising = result.rising_strain()
        axes.plot(
            100 * rising["E11"], rising["S11"], color=INK[0], alpha=0.55, linewidth=0.9, label=None if k else "a cell"
        )
    axes.axhline(mean, color=INK[1], linewidth=1.2, label=f"mean peak {mean:.1f} MPa")
    axes.axhspan(mean - scatter, mean + scatter, color=INK[1], alpha=0.15, linewidth=0, label="one standard deviation")
    axes.set(xlabel="$E_{11}$ (%)", ylabel="$\\Sigma_{11}$ (MPa)")
    axes.set_title(f"Glass/epoxy across the fibres, {len(found)} cells", fontsize=11)
    axes.set_ylim(bottom=0.0)
    axes.grid(color="0.92", linewidth=0.6)
    axes.legend(frameon=False, fontsize=9, loc="lower right")
    figure.savefig(folder / "transverse_strength.png")
    return [figures.tabulate(folder / "transverse_strength.csv", COLUMNS, rows), folder / "transverse_strength.png"]


if __name__ == "__main__":
    options = figures.quick_parser(__doc__ or "", "transverse_strength", "two cells of four fibres, long elements")
    options.add_argument("--law", default="energy", choices=list(INTERFACES), help="of the interface")
    options.add_argument("--teeth", type=int, default=16, help="of a bilinear law")
    options.add_argument("--seeds", type=int, default=10, help="arrangements: 0, 1, ...")
    options.add_argument("--fibres", type=int, default=50)
    options.add_argument("--fibre-fraction", type=float, default=0.5)
    options.add_argument("--refine", type=int, default=2)
    options.add_argument("--strain", type=float, default=0.02, help="E11 at the end")
    sys.exit(launch(main, options))
