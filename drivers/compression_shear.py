"""Transverse compression and shear of a cooled ply that debonds with friction: envelopes in (S22, S12).

    mpirun -n 2 .venv/bin/python drivers/compression_shear.py --out results/compression_shear

A random cell of glass fibres in epoxy, 50 %, generalized plane strain, first cools without stress, which clamps the
fibres.  Then it is pressed or pulled to S22, and then sheared by gamma12 at constant S22 without other stresses.  Bonds
have strengths of 40 and 60 MPa in opening and shear; debonded faces rub with each coefficient of `--frictions`.  A row
has S12 at the first break in shear, the largest S12, which counts as failure, and S12 at the strain `--strain`.  The
matrix stays elastic, so S12 would rise again without end.  `--fibres 30` gives a cell of the usual size.
"""

import argparse
import sys
from pathlib import Path

import figures
import numpy as np
from figures import INK
from mpi4py.MPI import Intracomm

from feti_homog import Case, Result, launch

MATERIAL = {  # MPa, 1/K
    "matrix": {"young": 2790.0, "poisson": 0.33, "expansion": 5.8e-5},
    "fibre": {"young": 70800.0, "poisson": 0.22, "expansion": 5.4e-6},
}
STRENGTHS = {"normal_strength": 40.0, "tangential_strength": 60.0}  # MPa
COLUMNS = ("friction", "S22", "first break S12", "largest S12", "S12 at end", "heat", "points")


def main(given: argparse.Namespace, comm: Intracomm) -> None:
    """Follow the path of each transverse stress and friction; print, write and draw."""
    if given.quick:
        given.fibres, given.refine, given.frictions, given.stresses = 2, 0, [0.0, 0.4], [-40.0, 0.0]
    found = {(mu, stress): solved(given, comm, mu, stress) for mu in given.frictions for stress in given.stresses}
    figures.finish(comm, write, given.out, given.cooling, found)


def solved(given: argparse.Namespace, comm: Intracomm, friction: float, stress: float) -> Result:
    """Return the path of one test."""
    # Beyond the first leg the load is controlled, with friction or without: no snap-back.
    cold = {"temperature": given.cooling}
    pressed = {"S22": stress} if stress else {"gamma12": 1e-3 * given.strain}
    legs = [cold, cold | pressed, cold | {"S22": stress, "gamma12": given.strain}]
    document = {
        "name": f"friction {friction:g}, S22 {stress:g} MPa",
        "cell": {
            "geometry": "random",
            "fibres": given.fibres,
            "fibre_fraction": 0.5,
            "min_gap": 0.06,
            "mesh_size": 0.5 * np.sqrt(0.5 / np.pi / given.fibres),
            "refine": given.refine,
        },
        "material": MATERIAL,
        "analysis": {"type": "path", "plane": "generalized"},
        "interface": STRENGTHS | {"friction": friction},
        "path": {"waypoints": legs},
        "output": figures.written(given) | {"stress_unit": "MPa"},
    }
    return figures.computed(comm, Case.parse(document), given.out / f"friction_{friction:g}_S22_{stress:g}")


def sheared(result: Result) -> np.ndarray:
    """Return (n, 3) gamma12 since shear began, S12 and numbers of breaking bonds at the points of the last leg."""
    points = result.points
    own = points["load_factor"] > 2 / 3 - 1e-9
    strain, stress = points["strain"][own, -1], points["stress"][own, -1]
    return np.column_stack([strain - strain[0], stress, points["broke"][own]])


def row(result: Result) -> list[float]:
    """Return S12 at the first break in shear, largest S12, last S12, heat of friction, and number of points."""
    _, stress, broke = sheared(result).T
    first = stress[np.flatnonzero(broke)[0]] if broke.any() else np.nan
    last = (result.path or ())[-1]
    heat = last.friction_heat or 0.0
    return [first, stress.max(), stress[-1], heat, len(result.path or ())]


def write(folder: Path, cooling: float, found: dict[tuple[float, float], Result]) -> list[Path]:
    """Write compression_shear.csv and compression_shear.png."""
    from matplotlib.figure import Figure

    rows = [[*key, *row(result)] for key, result in found.items()]
    print("friction  S22 MPa  first break S12 MPa  largest S12 MPa  at the end MPa  heat MPa  points")
    for friction, stress, first, largest, end, heat, points in rows:
        print(f"{friction:>8g}{stress:>9g}{first:>21.2f}{largest:>17.2f}{end:>16.2f}{heat:>10.4f}{points:>8}")
    figure = Figure(figsize=(9.0, 4.0), layout="constrained")
    left, right = figure.subplots(1, 2)
    frictions = list(dict.fromkeys(friction for friction, _ in found))
    pressed = min(stress for _, stress in found)
    for k, friction in enumerate(frictions):
        own = np.array([r[1:5] for r in rows if r[0] == friction])
        style = {"color": INK[k % len(INK)], "linewidth": 1.2}
        left.plot(own[:, 0], own[:, 1], "o--", markersize=3, alpha=0.6, **style)
        left.plot(own[:, 0], own[:, 2], "o-", markersize=4, label=f"friction {friction:g}", **style)
        strain, curve, _ = sheared(found[friction, pressed]).T
        right.plot(100 * strain, curve, **style)
    left.plot([], [], "o--", color="0.4", markersize=3, label="first break in shear")
    left.set(xlabel="$\\Sigma_{22}$ (MPa)", ylabel="$\\Sigma_{12}$ (MPa)")
    left.set_title(f"Largest shear and first break, cooled by {-cooling:g} K", fontsize=10)
    right.set(xlabel="$\\gamma_{12}$ (%)", ylabel="$\\Sigma_{12}$ (MPa)")
    right.set_title(f"Shear under {pressed:g} MPa", fontsize=10)
    for axes in (left, right):
        axes.set_ylim(bottom=0.0)
        axes.grid(color="0.92", linewidth=0.6)
    left.legend(frameon=False, fontsize=8)
    figure.savefig(folder / "compression_shear.png")
    return [figures.tabulate(folder / "compression_shear.csv", COLUMNS, rows), folder / "compression_shear.png"]


if __name__ == "__main__":
    options = figures.quick_parser(__doc__ or "", "compression_shear", "two fibres, long elements, four tests")
    options.add_argument("--fibres", type=int, default=4)
    options.add_argument("--refine", type=int, default=0)
    options.add_argument("--cooling", type=float, default=-100.0, help="change of temperature, K")
    options.add_argument("--strain", type=float, default=0.03, help="gamma12 at the end")
    options.add_argument("--frictions", type=float, nargs="+", default=[0.0, 0.2, 0.4, 0.6])
    options.add_argument("--stresses", type=float, nargs="+", default=[-80.0, -40.0, 0.0, 20.0], help="S22, MPa")
    sys.exit(launch(main, options))
