"""Error over the element size: stiffness, traction at the interface, energy release rate, peak of a cohesive law.

    mpirun -n 2 .venv/bin/python drivers/convergence.py --out results/convergence

Square cell, 40 % of fibres, plane strain, elements of both orders, each refined from one coarse mesh.  C11 and the
largest normal traction under E11 = 1 belong to the bonded cell (38) and have exact values.  G is the energy that the
tip of an arc of 120 degrees, without contact, releases under the same strain.  The peak is the largest S11 of the
bilinear law of cohesive_fibre.py, with eight teeth.  References of G and the peak are extrapolated from the two finest
meshes of order 2, the finest of which is not drawn.  The peak is one event among many, so its error is no exact power
of the element size.
"""

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import cohesive_fibre
import figures
import numpy as np
from effective_stiffness import REFERENCE
from figures import INK
from mpi4py import MPI
from mpi4py.MPI import Intracomm

from feti_homog import Case, launch

ARC = {"contact": False, "debonded": [{"fibre": 1}]}
PEAK = cohesive_fibre.Interface("bilinear", 0, 8)
COLUMNS = ("quantity", "order", "element / width", "elements", "value", "reference", "error", "rate")


class Quantity(NamedTuple):
    """A number of a cell (GPa and widths; peak in MPa), its exact value if known, and its rate by order."""

    title: str
    of: Callable[[argparse.Namespace, Intracomm, dict[str, Any], Path], tuple[float, int]]
    exact: float | None
    rates: dict[int, int]
    coarse: float = 0.2  # element size / width without refinement


class Point(NamedTuple):
    """A value on one mesh: element size / width, number of elements."""

    size: float
    elements: int
    value: float


def main(given: argparse.Namespace, comm: Intracomm) -> None:
    """Compute each quantity on all meshes; print, write and draw the errors."""
    finest = 2 if given.quick else given.refine
    meshes = [(order, refine) for order in (1, 2) for refine in range(finest + 1)]
    found: dict[str, dict[int, list[Point]]] = {}
    for name, quantity in QUANTITIES.items():
        found[name] = {1: [], 2: []}
        for order, refine in meshes:
            cell = {"geometry": "square", "fibre_fraction": 0.4, "mesh_size": quantity.coarse}
            cell |= {"refine": refine, "order": order}
            value, elements = quantity.of(given, comm, cell, given.out / f"{name}_{order}_{refine}")
            found[name][order].append(Point(quantity.coarse / 2**refine, elements, value))
    figures.finish(comm, write, given.out, found)


def bonded(given: argparse.Namespace, comm: Intracomm, cell: dict[str, Any], folder: Path) -> Any:
    """Return the result of the bonded cell, with fields."""
    sections = {"cell": cell, "material": figures.EQUATION_38, "output": figures.written(given) | {"fields": True}}
    case = Case.parse(sections | {"analysis": {"type": "stiffness", "plane": "strain"}, "interface": {"debonded": []}})
    return figures.computed(comm, case, folder, keep_fields=True)


def stiffness(given: argparse.Namespace, comm: Intracomm, cell: dict[str, Any], folder: Path) -> tuple[float, int]:
    """Return C11 and the number of elements."""
    result = bonded(given, comm, cell, folder)
    return float(result.effective_stiffness[0, 0]), result.cell.elements


def traction(given: argparse.Namespace, comm: Intracomm, cell: dict[str, Any], folder: Path) -> tuple[float, int]:
    """Return the largest normal traction under E11 = 1 and the number of elements."""
    result = bonded(given, comm, cell, folder)
    normal = result.fields.states[0].traction[:, 0]
    return float(comm.allreduce(normal.max(initial=0.0), MPI.MAX)), result.cell.elements


def release(given: argparse.Namespace, comm: Intracomm, cell: dict[str, Any], folder: Path) -> tuple[float, int]:
    """Return the mean G of both tips under E11 = 1 and the number of elements."""
    sections = {"cell": cell, "material": figures.EQUATION_38, "output": figures.written(given), "interface": ARC}
    sections |= {"analysis": {"type": "angle", "plane": "strain"}, "angle": {"values": [120.0], "strain": [1.0, 0, 0]}}
    result = figures.computed(comm, Case.parse(sections), folder)
    return float((result.angle or ())[0].tips.G.mean()), result.cell.elements


def peak(given: argparse.Namespace, comm: Intracomm, cell: dict[str, Any], folder: Path) -> tuple[float, int]:
    """Return the largest S11 of the cohesive law under rising strain and the number of elements."""
    sections: dict[str, Any] = {
        "cell": cell | {"fibre_radius": cohesive_fibre.RADIUS},
        "material": cohesive_fibre.MATERIAL,
        "analysis": {"type": "path", "plane": "strain"},
        "interface": PEAK.section(),
        "path": {"strain": [cohesive_fibre.UNIT, 0.0, 0.0]},
        "output": figures.written(given) | {"stress_unit": "MPa", "length_unit": "um"},
    }
    result = figures.computed(comm, Case.parse(sections), folder)
    return float(result.rising_strain()["S11"].max()), result.cell.elements


EXACT_TRACTION = 179.276113  # at 0 degrees, by multipole series, as REFERENCE
QUANTITIES = {
    "stiffness": Quantity("effective stiffness $C_{11}$", stiffness, REFERENCE["square", "strain"][0], {1: 2, 2: 4}),
    "traction": Quantity("largest normal traction", traction, EXACT_TRACTION, {1: 2, 2: 2}),
    "release": Quantity("energy release rate, 120 degrees", release, None, {1: 2, 2: 4}),
    "peak": Quantity("peak of a cohesive law", peak, None, {1: 2, 2: 2}, 0.1),
}


def write(folder: Path, found: dict[str, dict[int, list[Point]]]) -> list[Path]:
    """Write convergence.csv and convergence.png."""
    from matplotlib.figure import Figure

    print(f"{'quantity':<11}order  element  elements{'value':>13}{'reference':>13}{'error':>10}  rate")
    rows: list[list[Any]] = []
    figure = Figure(figsize=(9.6, 7.6), layout="constrained")
    for axes, (name, orders) in zip(figure.subplots(2, 2).flat, found.items(), strict=True):
        quantity = QUANTITIES[name]
        coarse, fine = (point.value for point in orders[2][-2:])
        reference = quantity.exact or fine + (fine - coarse) / (2 ** quantity.rates[2] - 1)
        for order, points in orders.items():
            drawn = points if quantity.exact or order == 1 else points[:-1]
            sizes, errors = np.array([p.size for p in drawn]), np.array([abs(p.value / reference - 1) for p in drawn])
            rates = [np.nan, *np.log2(errors[:-1] / errors[1:])]
            for p, error, rate in zip(drawn, errors, rates, strict=True):
                rows.append([name, order, p.size, p.elements, p.value, reference, error, rate])
                shown = "" if np.isnan(rate) else f"{rate:6.2f}"
                print(
                    f"{name:<11}{order:>5}{p.size:>9.4g}{p.elements:>10}{p.value:>13.6f}{reference:>13.6f}"
                    f"{error:>10.1e}{shown}"
                )
            axes.plot(sizes, errors, "o-", color=INK[order - 1], label=f"order {order}")
            power = quantity.rates[order]
            slope = sizes**power * np.exp(np.log(errors / sizes**power).mean())
            axes.plot(sizes, slope, "--", color=INK[order - 1], linewidth=0.8, label=f"$h^{power}$")
        axes.set(xscale="log", yscale="log", title=quantity.title, ylabel="relative error")
        ticks = [p.size for p in orders[1]]
        axes.set_xticks(ticks, [f"{size:g}" for size in ticks])
        axes.set_xticks([], minor=True)
        axes.set_xlabel("element size / width")
        axes.grid(color="0.92", linewidth=0.6, which="both")
        axes.legend(frameon=False, fontsize=9)
    figure.savefig(folder / "convergence.png")
    return [figures.tabulate(folder / "convergence.csv", COLUMNS, rows), folder / "convergence.png"]


if __name__ == "__main__":
    options = figures.quick_parser(__doc__ or "", "convergence", "three meshes of each order")
    options.add_argument("--refine", type=int, default=3, help="times that the coarse mesh is refined at most")
    sys.exit(launch(main, options))
