"""Closed-form estimates against cells: all constants of glass/epoxy and similar plies over fraction and contrast.

    mpirun -n 2 .venv/bin/python drivers/micromechanics.py --out results/micromechanics

The paper's conclusion asks for this comparison.  Long fibres (plane = "generalized") in square, hexagonal and random
cells; constants describe the nearest transversely isotropic material, in random cells the mean over seeds.  Every
result lists the estimates beside its own constants; only the phases and their fractions enter the estimates.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import figures
import numpy as np
from figures import INK
from mpi4py.MPI import Intracomm
from numpy.typing import NDArray

from feti_homog import Case, Result, launch

EPOXY = {"young": 3.45, "poisson": 0.35, "expansion": 54e-6}
GLASS = {"poisson": 0.22, "expansion": 5e-6}
TITLES = {
    f"{name}_{way}": f"{title[0]} {words}{title[1]}"
    for name, title in {"E": ("$E$", " (GPa)"), "nu": (r"$\nu$", ""), "G": ("$G$", " (GPa)"),
                        "expansion": (r"$\alpha$", " (1e-6/K)")}.items()
    for way, words in (("axial", "along the fibres"), ("transverse", "across the fibres"))
}  # fmt: skip
NAMES = tuple(TITLES)
METHODS = {
    "rule_of_mixtures": ("Rule of mixtures", ":"), "chamis": ("Chamis", (0, (1, 3))),
    "halpin_tsai": ("Halpin and Tsai", "-."), "mori_tanaka": ("Mori and Tanaka", "--"),
    "composite_cylinders": ("Composite cylinders", (0, (8, 2))), "self_consistent": ("Self-consistent", "-"),
}  # fmt: skip
MARKS = {"square": "s", "hexagonal": "h", "random": "o"}
Table = dict[tuple[str, float, float], NDArray[np.float64]]


def main(given: argparse.Namespace, comm: Intracomm) -> None:
    """Solve every cell; print, write and draw the comparison."""
    if given.quick:
        given.fractions, given.contrasts, given.seeds, given.fibres = [0.3, 0.5], [20.0], 1, 6
    cells: Table = {}
    estimates: dict[str, dict[tuple[float, float], NDArray[np.float64]]] = {method: {} for method in METHODS}
    for contrast in given.contrasts:
        for fraction in given.fractions:
            for geometry in MARKS:
                seeds = range(given.seeds if geometry == "random" else 1)
                found = [solved(given, comm, geometry, contrast, fraction, seed) for seed in seeds]
                cells[geometry, contrast, fraction] = np.mean([row(r.transversely_isotropic) for r in found], axis=0)
            for method in METHODS:
                estimates[method][contrast, fraction] = row(getattr(found[0].estimates, method))
    figures.finish(comm, write, given.out, given.contrasts, given.fractions, cells, estimates)


def solved(
    given: argparse.Namespace, comm: Intracomm, geometry: str, contrast: float, fraction: float, seed: int
) -> Result:
    """Return the stiffness of one cell."""
    cell: dict[str, Any] = {"geometry": geometry, "fibre_fraction": fraction, "order": 2}
    cell |= {"mesh_size": 0.25 if given.quick else given.mesh_size, "refine": 0 if given.quick else given.refine}
    if geometry == "random":
        cell |= {"fibres": given.fibres, "seed": seed, "min_gap": 0.04, "mesh_size": cell["mesh_size"] / 2}
    material = {"matrix": EPOXY, "fibre": GLASS | {"young": contrast * EPOXY["young"]}}
    name = f"{geometry} {contrast:g} {fraction:g}" + (f" {seed}" if geometry == "random" else "")
    document = {
        "name": name,
        "cell": cell,
        "material": material,
        "analysis": {"type": "stiffness", "plane": "generalized"},
        "output": figures.written(given),
    }
    return figures.computed(comm, Case.parse(document), given.out / name.replace(" ", "_"))


def row(constants: Any) -> NDArray[np.float64]:
    """Return the values of NAMES, NaN where a method gives none."""
    return np.array([getattr(constants, name) for name in NAMES], float)


def write(
    folder: Path,
    contrasts: Sequence[float],
    fractions: Sequence[float],
    cells: Table,
    estimates: dict[str, dict[tuple[float, float], NDArray[np.float64]]],
) -> list[Path]:
    """Write micromechanics.csv and micromechanics.png; print the errors."""
    rows: list[list[Any]] = [["cell", *key, *values] for key, values in cells.items()]
    rows += [
        ["estimate", method, *key, *values] for method, found in estimates.items() for key, values in found.items()
    ]
    for contrast in contrasts:
        print(f"Largest error in per cent, hexagonal and random cells, E_fibre / E_matrix = {contrast:g}")
        print(f"{'':<20}" + "".join(f"{name:>21}" for name in NAMES))
        for method, found in estimates.items():
            errors = [
                np.abs(found[contrast, c] / cells[geometry, contrast, c] - 1.0)
                for c in fractions
                for geometry in ("hexagonal", "random")
            ]
            words = (f"{100 * value:.2f}" if np.isfinite(value) else "-" for value in np.max(errors, axis=0))
            print(f"{method:<20}" + "".join(f"{word:>21}" for word in words))
    path = folder / "micromechanics.png"
    _draw(path, contrasts[len(contrasts) // 2], fractions, cells, estimates)
    header = ["kind", "geometry or method", "contrast", "fibre_fraction", *NAMES]
    return [figures.tabulate(folder / "micromechanics.csv", header, rows), path]


def _draw(
    path: Path,
    contrast: float,
    fractions: Sequence[float],
    cells: Table,
    estimates: dict[str, dict[tuple[float, float], NDArray[np.float64]]],
) -> None:
    """Draw a panel per constant: points are cells, lines estimates."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12.0, 6.0), layout="constrained")
    for k, (name, axes) in enumerate(zip(NAMES, figure.subplots(2, 4).ravel(), strict=True)):
        scale = 1e-6 if name.startswith("expansion") else 1.0
        for (method, (words, style)), ink in zip(METHODS.items(), (*INK, "0.5", "k"), strict=True):
            values = [estimates[method][contrast, c][k] / scale for c in fractions]
            axes.plot(fractions, values, linestyle=style, color=ink, linewidth=1.4, label=words)
        for geometry, mark in MARKS.items():
            values = [cells[geometry, contrast, c][k] / scale for c in fractions]
            axes.plot(fractions, values, mark, color="k", markerfacecolor="none", label=f"{geometry.capitalize()} cell")
        axes.set(title=TITLES[name], xlabel="Fibre fraction")
        axes.grid(color="0.92", linewidth=0.6)
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=5, frameon=False)
    figure.suptitle(f"$E_f / E_m$ = {contrast:g}", fontsize=10)
    figure.savefig(path)


def parser() -> argparse.ArgumentParser:
    options = figures.quick_parser(__doc__ or "", "micromechanics", "coarse meshes, one contrast, two fractions")
    options.add_argument("--fractions", type=float, nargs="+", default=[0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7])
    options.add_argument("--contrasts", type=float, nargs="+", default=[2.0, 20.0, 200.0], help="E_fibre / E_matrix")
    options.add_argument("--seeds", type=int, default=3, help="random cells of each fraction")
    options.add_argument("--fibres", type=int, default=30, help="of a random cell")
    options.add_argument("--mesh-size", type=float, default=0.1)
    options.add_argument("--refine", type=int, default=1)
    return options


if __name__ == "__main__":
    sys.exit(launch(main, parser()))
