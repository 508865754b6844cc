"""Tests of a glass/epoxy ply: tension across the fibres and shear along them, without and after cooling.

    mpirun -n 2 .venv/bin/python drivers/ply_strength.py --out results/ply_strength

A random cell of long fibres that debond by energy.  Tension is a uniaxial test with rising E22 and no other stress;
shear is a rising gamma23, along the fibres.  Cooling comes first, free of stress: the matrix shrinks onto the fibres.
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
    "matrix": {"young": 2790.0, "poisson": 0.33, "expansion": 60e-6},
    "fibre": {"young": 70800.0, "poisson": 0.22, "expansion": 5e-6},
}
INTERFACE = {  # MPa/um, J/m2
    "normal_stiffness": 2025.0,
    "tangential_stiffness": 506.25,
    "criterion": "energy",
    "toughness": 2.0,
}
RADIUS = 7.5  # um
# Strain that rises, its end, its place, and its stress.
TESTS = {"tension": ("E22", 0.02, 1, "S22"), "shear": ("gamma23", 0.08, 3, "S23")}
COLUMNS = ("test", "temperature", "modulus", "first break", "peak", "strain at peak", "points")


def main(given: argparse.Namespace, comm: Intracomm) -> None:
    """Follow each test after each change of temperature; print, write and draw."""
    if given.quick:
        given.fibres, given.refine = 2, 0
    given.temperatures = given.temperatures or ([0.0, -100.0] if given.quick else [0.0, -50.0, -100.0])
    found = {
        (test, temperature): solved(given, comm, test, temperature)
        for test in TESTS
        for temperature in given.temperatures
    }
    figures.finish(comm, write, given.out, found)


def solved(given: argparse.Namespace, comm: Intracomm, test: str, temperature: float) -> Result:
    """Return the path of one test."""
    strain, end, _, _ = TESTS[test]
    cooling = [{"temperature": temperature}] if temperature else []
    document = {
        "name": f"{test} {temperature:g} K",
        "cell": {
            "geometry": "random",
            "fibres": given.fibres,
            "fibre_radius": RADIUS,
            "fibre_fraction": 0.5,
            "min_gap": 0.06,
            "mesh_size": 3.3 / RADIUS * np.sqrt(0.5 / np.pi / given.fibres),
            "refine": given.refine,
        },
        "material": MATERIAL,
        "analysis": {"type": "path", "plane": "generalized"},
        "interface": INTERFACE,
        "path": {"waypoints": [*cooling, {strain: end}]},
        "output": figures.written(given) | {"stress_unit": "MPa", "length_unit": "um"},
    }
    return figures.computed(comm, Case.parse(document), given.out / f"{test}_{temperature:g}K")


def curve(result: Result, component: int) -> np.ndarray:
    """Return (n, 2) strain since the load began and stress, as in a test with rising strain."""
    if len(result.case["path"]["waypoints"]) == 1:
        strain, *stresses = result.rising_strain().values()
        return np.column_stack([strain, stresses[component]])
    points = result.points
    found = np.column_stack([points["strain"][:, component], points["stress"][:, component]])
    cooled = int(np.flatnonzero(points["load_factor"] <= 0.5)[-1])
    found = found[cooled + 1 :] - [found[cooled, 0], 0.0]
    return np.vstack([np.zeros(2), found])


def row(result: Result, component: int) -> list[float]:
    """Return modulus, stress of the first break, peak, strain at the peak, and number of points."""
    found = curve(result, component)
    broken = [point.stress[component] for point in result.path or () if point.broke]
    peak = int(found[:, 1].argmax())
    return [found[1, 1] / found[1, 0], broken[0], found[peak, 1], found[peak, 0], len(result.path or ())]


def write(folder: Path, found: dict[tuple[str, float], Result]) -> list[Path]:
    """Write ply_strength.csv and ply_strength.png."""
    from matplotlib.figure import Figure

    rows = [[test, temperature, *row(result, TESTS[test][2])] for (test, temperature), result in found.items()]
    print("test     temperature K  modulus MPa  first break MPa  peak MPa  at strain  points")
    for test, temperature, modulus, first, peak, strain, points in rows:
        print(f"{test:<9}{temperature:>13g}{modulus:>13.0f}{first:>17.2f}{peak:>10.2f}{strain:>11.5f}{points:>8}")
    figure = Figure(figsize=(9.0, 4.0), layout="constrained")
    for axes, (test, (strain, _, component, stress)) in zip(figure.subplots(1, 2), TESTS.items(), strict=True):
        own = {temperature: result for (name, temperature), result in found.items() if name == test}
        for k, (temperature, result) in enumerate(own.items()):
            points, colour = curve(result, component), INK[k % len(INK)]
            change = "cooled" if temperature < 0.0 else "heated"
            label = f"{change} by {abs(temperature):g} K" if temperature else "not cooled"
            axes.plot(100 * points[:, 0], points[:, 1], color=colour, linewidth=1.2, label=label)
        axes.set(xlabel=f"${symbol(strain)}$ (%)", ylabel=f"${symbol(stress)}$ (MPa)")
        axes.set_title({"tension": "Tension across the fibres", "shear": "Shear along the fibres"}[test], fontsize=11)
        axes.set_xlim(left=0.0)
        axes.set_ylim(bottom=0.0)
        axes.grid(color="0.92", linewidth=0.6)
        axes.legend(frameon=False, fontsize=9, loc="lower right")
    figure.savefig(folder / "ply_strength.png")
    return [figures.tabulate(folder / "ply_strength.csv", COLUMNS, rows), folder / "ply_strength.png"]


def symbol(component: str) -> str:
    """Return a component as LaTeX."""
    letter = {"E": "E", "S": "\\Sigma", "g": "\\gamma"}[component[0]]
    return f"{letter}_{{{component[-2:]}}}"


if __name__ == "__main__":
    options = figures.quick_parser(__doc__ or "", "ply_strength", "two fibres, long elements")
    options.add_argument("--fibres", type=int, default=20)
    options.add_argument("--refine", type=int, default=2)
    words = "changes, K (default: 0 -50 -100; with --quick 0 -100)"
    options.add_argument("--temperatures", type=float, nargs="+", help=words)
    sys.exit(launch(main, options))
