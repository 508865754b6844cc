"""Fig. 5 of the paper: stress-strain curves of a single-fibre cell (42) that debonds under E = [0.2, 0, 0] (41).

    mpirun -n 2 .venv/bin/python drivers/stress_strain.py --out results/stress_strain

Plane stress, 40 % of fibres, contact after debonding.  Each curve is for one pair of strengths R^n, R^t, tractions in
GPa.  Thick: the strain only rises, so the stress drops where bonds break; thin: all equilibria, snap-back included.
After its first drop a curve depends on the mesh: the mesh is in the title, compare others with --mesh-size.  The paper
prints curves, no numbers: the driver compares strain and stress at onset with a finer bonded cell, mesh_size = 0.1,
refine = 3, order = 2, extrapolated.
"""

import argparse
import sys
from pathlib import Path

import figures
import numpy as np
from figures import INK
from mpi4py.MPI import Intracomm

from feti_homog import Result, launch

STRENGTHS = [(5.0, 5.0), (10.0, 10.0), (10.0, 5.0), (5.0, 1.5)]  # GPa: R^n, R^t
STRAIN = [0.2, 0.0, 0.0]
# C11 of the bonded cell and its largest normal and shear tractions under E11 = 1, GPa.
BONDED, LARGEST = 191.63371, (258.217, 79.565)
HEADS = "    Rn    Rt  nodes  onset E11       S11 after drop   debonded  S11 at end   onset E11, S11 of bonded cell"
COLUMNS = ("Rn", "Rt", "load_factor", "E11", "S11", "S22", "S12", "bonded", "open", "closed", "dissipated")


def main(given: argparse.Namespace, comm: Intracomm) -> None:
    """Run a path for each pair of strengths; print, write and draw the curves."""
    curves = {}
    for normal, tangential in STRENGTHS[:2] if given.quick else STRENGTHS:
        curves[normal, tangential] = figures.solved(
            given, comm, f"Rn {normal:g} Rt {tangential:g}", "square", figures.EQUATION_42,
            analysis={"type": "path", "plane": "stress"},
            interface={"normal_strength": normal, "tangential_strength": tangential},
            path={"strain": STRAIN},
        )  # fmt: skip
    figures.finish(comm, write, given.out, curves)


def drop(normal: float, tangential: float, result: Result) -> str:
    """Return the onset, the state after the first drop under rising strain, and the end."""
    points = result.path or ()
    onset, end = points[0], points[-1]
    # At the load of the first break, on the branch of the next point at a load as large.
    number = next((k for k, p in enumerate(points) if k and p.load_factor >= onset.load_factor), len(points) - 1)
    fallen = points[number].stress * onset.load_factor / points[number].load_factor
    total = onset.bonded + onset.open + onset.closed
    share = 1.0 - points[number].bonded / total
    strain = min(normal / LARGEST[0], tangential / LARGEST[1])
    off = onset.strain[0] / strain - 1, onset.stress[0] / (BONDED * strain) - 1
    return (
        f"{normal:>6g}{tangential:>6g}{total:>7}{onset.strain[0]:>11.6f}{onset.stress[0]:>10.4f}"
        f"{fallen[0]:>10.4f}{100 * share:>9.1f} %{end.stress[0]:>10.4f}"
        f"{off[0]:>+13.1%}, {off[1]:+.1%}"
    )


def write(folder: Path, curves: dict[tuple[float, float], Result]) -> list[Path]:
    """Write stress_strain.csv and stress_strain.png."""
    from matplotlib.figure import Figure

    print(HEADS)
    rows = []
    figure = Figure(figsize=(9.6, 4.4), layout="constrained")
    grid = figure.subplots(1, 2, sharex=True)
    # Narrower from curve to curve, so that those beneath are seen where they coincide.
    for ((normal, tangential), result), ink, width in zip(curves.items(), INK, (3.0, 2.4, 1.8, 1.2), strict=False):
        for p in result.path or ():
            numbers = [p.load_factor, p.strain[0], *p.stress, p.bonded, p.open, p.closed, p.dissipated]
            rows.append([normal, tangential, *numbers])
        print(drop(normal, tangential, result))
        rising, points = result.rising_strain(), result.points
        label = f"$R^\\mathrm{{n}}$ = {normal:g}, $R^\\mathrm{{t}}$ = {tangential:g} GPa"
        for k, axes in enumerate(grid):
            strain, stress = np.append(0.0, points["strain"][:, 0]), np.append(0.0, points["stress"][:, k])
            axes.plot(strain, stress, color=ink, linewidth=0.6, alpha=0.8)
            axes.plot(rising["E11"], rising[("S11", "S22")[k]], color=ink, linewidth=width, label=label)
    for axes, component, where in zip(grid, ("11", "22"), ("along", "across"), strict=True):
        axes.set(xlabel="$E_{11}$", ylabel=f"$\\Sigma_{{{component}}}$ (GPa)", title=f"{where} the strain")
        axes.axhline(0.0, color="0.6", linewidth=0.6, zorder=0)
        axes.grid(color="0.92", linewidth=0.6)
    grid[0].legend(frameon=False, fontsize=9)
    figure.suptitle(f"Single-fibre cell, plane stress, {result.cell.elements} elements", fontsize=11)
    figure.savefig(folder / "stress_strain.png")
    return [figures.tabulate(folder / "stress_strain.csv", COLUMNS, rows), folder / "stress_strain.png"]


if __name__ == "__main__":
    options = figures.parser(__doc__ or "", "stress_strain", mesh_size=0.04, refine=0, order=1)
    sys.exit(launch(main, options))
