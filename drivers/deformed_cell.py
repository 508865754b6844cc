"""Fig. 4 of the paper: the hexagonal cell (38) under E = [0, 0, 0.2], without and with contact, at true scale.

    mpirun -n 2 .venv/bin/python drivers/deformed_cell.py --out results/deformed_cell

The debonding angle is the whole opening of one arc on every fibre, centred on the positive x1 axis through its centre.
Without contact the faces overlap, and the material drawn last hides the other material.
"""

import argparse
import sys
from pathlib import Path

import figures
from mpi4py import MPI
from mpi4py.MPI import Intracomm

from feti_homog import Result, draw_state, launch

CASES = {"without contact": False, "with contact": True}
MOST = 12.0  # GPa, of the colours of both
COLUMNS = ("case", "S11", "S22", "S12", "bonded", "open", "closed", "largest overlap")


def main(given: argparse.Namespace, comm: Intracomm) -> None:
    """Run both cases, write a table and draw them side by side."""
    results, overlaps = {}, {}
    for name, contact in CASES.items():
        result = figures.solved(
            given, comm, name, "hexagonal", figures.EQUATION_38, keep_fields=True,
            analysis={"type": "angle", "plane": "strain"},
            interface={"contact": contact, "debonded": [{"fibre": "all", "centre": 0.0}]},
            angle={"values": [given.angle], "strain": [0.0, 0.0, 0.2]}, output={"fields": True},
        )  # fmt: skip
        results[name], overlaps[name] = result, largest_overlap(result, comm)
    figures.finish(comm, write, given.out, results, overlaps)


def largest_overlap(result: Result, comm: Intracomm) -> float:
    """Return the largest overlap of matrix and fibre: minus the smallest gap at the nodes of all ranks."""
    if result.fields is None:
        raise ValueError("the case was run without fields")
    (state,) = result.fields.states
    return float(comm.allreduce(-state.jump[:, 0].min(initial=0.0), MPI.MAX))


def write(folder: Path, results: dict[str, Result], overlaps: dict[str, float]) -> list[Path]:
    """Write deformed_cell.csv and deformed_cell.png."""
    from matplotlib.figure import Figure

    print("the paper has no numbers, but contact without overlap, which stiffens the shear and makes normal stresses")
    for name, result in results.items():
        S11, S22, S12 = (result.angle or ())[0].stress.tolist()
        print(f"{name:<16} overlap {overlaps[name]:9.1e}  S11 {S11:8.4f}  S22 {S22:8.4f}  S12 {S12:8.4f}")

    figure = Figure(figsize=(8.4, 6.4), layout="constrained")
    grid, rows = figure.subplots(1, 2, sharex=True, sharey=True), []
    for axes, (name, result) in zip(grid, results.items(), strict=True):
        caption, (point,) = draw_state(axes, folder / name.replace(" ", "_"), most=MOST), result.angle or ()
        stress = point.stress.tolist()
        sigma = ", ".join(f"{round(s, 2) + 0.0:.2f}" for s in stress)
        axes.set_title(f"{name}\n$\\Sigma$ = [{sigma}] GPa\nlargest overlap {overlaps[name]:.3f}", fontsize=10)
        rows.append([name, *stress, point.bonded, point.open, point.closed, overlaps[name]])
    title = f"$E = [0, 0, 0.2]$, plane strain, debonding angle {point.angle:g} degrees; {caption}"
    figure.suptitle(title, fontsize=11)
    figure.legend(*grid[0].get_legend_handles_labels(), loc="outside lower center", ncols=3, frameon=False)
    figure.savefig(folder / "deformed_cell.png")
    return [figures.tabulate(folder / "deformed_cell.csv", COLUMNS, rows), folder / "deformed_cell.png"]


def parser() -> argparse.ArgumentParser:
    options = figures.parser(__doc__ or "", "deformed_cell", mesh_size=0.05, refine=1, order=2)
    options.add_argument("--angle", type=float, default=180.0, help="debonding angle in degrees")
    return options


if __name__ == "__main__":
    sys.exit(launch(main, parser()))
