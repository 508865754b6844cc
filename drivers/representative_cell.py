"""Size of a representative cell: apparent stiffness and its scatter against the number of fibres.

    mpirun -n 2 .venv/bin/python drivers/representative_cell.py --out results/representative_cell

Random cells of 50 % fibres with E = 200, nu = 0.222 in a matrix with E = 88, nu = 0.299 (GPa), plane strain, several
arrangements of each number of fibres.  A cell is representative if the mean no longer moves by more than its confidence
interval, and one arrangement scatters by less than a given share.  The driver is a sweep: started again, it continues.
It writes statistics.csv and representative_cell.png.
"""

import argparse
import sys
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import sweeping
from figures import INK
from matplotlib.figure import Figure
from mpi4py.MPI import Intracomm

from feti_homog import launch

NAMES = ("C11", "bulk", "shear")


def main(given: argparse.Namespace, comm: Intracomm) -> None:
    """Run the sweep, print means and scatter for each size, name the representative one, and draw."""
    sweeping.swept(given, comm, document(given), partial(report, given), draw)


def document(given: argparse.Namespace) -> dict[str, Any]:
    """Return the sweep as a TOML file would have it; the mesh beside a fibre is as fine for any number of fibres."""
    cell = {
        "geometry": "random", "fibre_fraction": given.fibre_fraction, "min_gap": given.min_gap,
        "refine": given.refine, "order": given.order, "seed": given.seed,
    }  # fmt: skip
    return {
        "name": "representative cell",
        "cell": cell,
        **sweeping.STIFFNESS,
        "sweep": {
            "mode": "zip",
            "realisations": given.realisations,
            "cell.fibres": given.fibres,
            "cell.mesh_size": [round(min(0.5, given.mesh_size / fibres**0.5), 4) for fibres in given.fibres],
        },
    }


def report(given: argparse.Namespace, table: Any) -> list[str]:
    """Return a line for each number of fibres: mean, half of its 95 % interval, and standard deviation of one cell."""
    tolerance = given.tolerance
    heads = "".join(f"{name + ' (GPa)':>12}{'+-':>9}{'std %':>8}" for name in NAMES)
    lines, more = [f"{'fibres':>6}{heads}"], []
    enough = None
    for number, point in enumerate(table.points):
        fibres = table.inputs["cell.fibres"][table.rows(point)[0]]
        line, worst = f"{fibres:>6}", 0.0
        for name in NAMES:
            found = table.statistics[name]
            scatter = float(found.std[number] / found.mean[number])
            line += f"{found.mean[number]:>12.4f}{found.ci95[number]:>9.4f}{100 * scatter:>8.3f}"
            worst = max(worst, scatter)
        lines.append(line)
        more.append(f"{fibres:>6} fibres: {_laws(table.statistics, number)}")
        enough = fibres if enough is None and worst <= tolerance else enough if worst <= tolerance else None
    answer = f"from {enough} fibres on" if enough is not None else "no cell here is that large"
    return [*lines, *more, f"one cell scatters by less than {100 * tolerance:g} %: {answer}"]


def draw(folder: Path, table: Any) -> Path:
    """Draw the means with their 95 % intervals, and below the scatter of a cell and of the mean."""
    figure = Figure(figsize=(12.0, 6.6), layout="constrained")
    fibres = np.array([table.inputs["cell.fibres"][table.rows(point)[0]] for point in table.points])
    for name, upper, lower in zip(NAMES, *figure.subplots(2, len(NAMES), sharex=True), strict=True):
        found = table.statistics[name]
        for x, point in zip(fibres, table.points, strict=True):
            rows = table.rows(point)
            upper.plot([0.94 * x] * len(rows), table.outputs[name][rows], ".", color="0.7")
        upper.errorbar(fibres, found.mean, found.ci95, marker="o", color=INK[0])
        upper.set_ylabel(f"{name} (GPa)")
        for values, style, words in (
            (found.std, "-", "standard deviation of a cell"),
            (found.ci95, ":", "95 % interval"),
        ):
            lower.plot(fibres, 100 * values / found.mean, style, marker="o", color=INK[0], label=words)
        lower.set(xlabel="number of fibres", ylabel="scatter / mean (%)", ylim=(0.0, None), xscale="log")
        lower.set_xlim(fibres[0] / 1.3, fibres[-1] * 1.3)
        lower.set_xticks(fibres, [str(x) for x in fibres])
        lower.minorticks_off()
    lower.legend(frameon=False)
    figure.savefig(folder / "representative_cell.png")
    return folder / "representative_cell.png"


def _laws(statistics: Any, number: int) -> str:
    """Return whether the means are isotropic and between the Hashin-Shtrikman bounds, in words."""
    found = []
    for name, words in (("anisotropy_normal", "C11 - C22"), ("anisotropy_shear", "C33 - (C11 + C22 - 2 C12)/4")):
        mean, half = statistics[name].mean[number], statistics[name].ci95[number]
        found.append(f"{words} = {mean:.4f} +- {half:.4f}")
    for name in ("bulk", "shear"):
        lower, upper = (statistics[f"{name}_{side}"].mean[number] for side in ("lower", "upper"))
        inside = lower <= statistics[name].mean[number] <= upper
        found.append(f"{name} {'between' if inside else 'outside of'} {lower:.4f} and {upper:.4f}")
    return "; ".join(found)


def _parser() -> argparse.ArgumentParser:
    options = sweeping.parser(__doc__ or "", "representative_cell")
    options.add_argument("--fibres", type=int, nargs="+", default=[4, 8, 16, 32, 64], help="numbers of fibres")
    options.add_argument("--realisations", type=int, default=20, help="arrangements of each number")
    options.add_argument("--seed", type=int, default=0, help="of the first arrangement")
    options.add_argument("--fibre-fraction", type=float, default=0.5)
    options.add_argument("--min-gap", type=float, default=0.05, help="smallest gap / diameter of a fibre")
    options.add_argument("--mesh-size", type=float, default=0.5, help="of the coarse elements / pitch of fibres")
    options.add_argument("--tolerance", type=float, default=0.002, help="relative scatter of a representative cell")
    return options


if __name__ == "__main__":
    sys.exit(launch(main, _parser()))
