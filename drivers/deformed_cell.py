"""Fig. 4 of the paper: the hexagonal cell (38) under E = [0, 0, 0.2], without and with contact, at true scale.

    mpirun -n 2 .venv/bin/python drivers/deformed_cell.py --out results/deformed_cell

The debonding angle is the whole opening of one arc on every fibre, centred on the positive x1 axis through its centre.
Without contact the faces overlap, and the material that is drawn last hides the other.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import figures
from mpi4py.MPI import Intracomm

from feti_homog.cli import launch, parsed

CASES = {"without contact": False, "with contact": True}
COLUMNS = ("case", "S11", "S22", "S12", "bonded", "open", "closed", "largest overlap")


def main(words: Sequence[str], comm: Intracomm) -> int:
    options = figures.parser(__doc__ or "", "deformed_cell", mesh_size=0.05, refine=1, order=2)
    options.add_argument("--angle", type=float, default=180.0, help="debonding angle in degrees")
    given = parsed(options, words, comm)
    points = {}
    for name, contact in CASES.items():
        document = figures.solved(
            given, comm, name, "hexagonal", figures.EQUATION_38,
            analysis={"type": "angle", "plane": "strain"},
            interface={"contact": contact, "debonded": [{"fibre": "all", "centre": 0.0}]},
            angle={"values": [given.angle], "strain": [0.0, 0.0, 0.2]}, output={"fields": True},
        )  # fmt: skip
        points[name] = document["angle"][0]
    return figures.finish(comm, write, given.out, points)


def write(folder: Path, points: dict[str, Any]) -> list[Path]:
    """deformed_cell.csv and deformed_cell.png."""
    import h5py
    from matplotlib.figure import Figure

    from feti_homog.output.plots.deformed_panels import Scene
    from feti_homog.output.plots.interface_marks import WORDS, legend

    figure = Figure(figsize=(8.4, 6.4), layout="constrained")
    grid, rows = figure.subplots(1, 2, sharex=True, sharey=True), []
    for axes, (name, point) in zip(grid, points.items(), strict=True):
        with h5py.File(folder / name.replace(" ", "_") / "result.h5", "r") as file:
            scene = Scene.of(file, [0], {}, true=True, limit=60_000)
            scene.draw(figure, axes, 0, scene.moved(0))
            words = scene.words
            overlap = max(0.0, -float(file["state/0/jump"][:, 0].min(initial=0.0)))
        axes.autoscale_view()
        sigma = ", ".join(f"{round(s, 2) + 0.0:.2f}" for s in point["stress"])
        axes.set_title(f"{name}\n$\\Sigma$ = [{sigma}] GPa\nlargest overlap {overlap:.3f}", fontsize=10)
        rows.append([name, *point["stress"], *(point[state] for state in ("bonded", "open", "closed")), overlap])
    angle = next(iter(points.values()))["angle"]
    figure.suptitle(f"$E = [0, 0, 0.2]$, plane strain, debonding angle {angle:g} degrees; {words}", fontsize=11)
    figure.legend(handles=legend(list(WORDS)), loc="outside lower center", ncols=3, frameon=False)
    figure.savefig(folder / "deformed_cell.png")
    return [figures.tabulate(folder / "deformed_cell.csv", COLUMNS, rows), folder / "deformed_cell.png"]


if __name__ == "__main__":
    sys.exit(launch(main))
