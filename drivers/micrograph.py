"""From a micrograph to numbers: stiffness, onset of debonding, and where the interfaces carry most.

    mpirun -n 2 .venv/bin/python drivers/micrograph.py --out results/micrograph

meshes/micrograph.csv lists about 200 fibres in a window, which is made periodic.  Glass/epoxy in plane strain, bonds of
40 MPa in tension and 60 MPa in shear.  The table lists each fibre's largest traction under S11 and its local fibre
fraction, fibre area / Voronoi cell area.
"""

import argparse
import sys
from pathlib import Path
from typing import Any

import figures
import numpy as np
from figures import INK
from mpi4py.MPI import Intracomm
from pattern_statistics import voronoi_cells

from feti_homog import Case, Result, launch
from feti_homog.microstructure.fibre_pattern import FibrePattern

TABLE = Path(__file__).parents[1] / "meshes" / "micrograph.csv"
MATERIAL = {"matrix": {"young": 2790.0, "poisson": 0.33}, "fibre": {"young": 70800.0, "poisson": 0.22}}  # MPa
TRACTION = "largest normal traction / $\\Sigma_{11}$"
STRENGTHS = {"normal_strength": 40.0, "tangential_strength": 60.0}  # MPa


def main(given: argparse.Namespace, comm: Intracomm) -> None:
    """Run both analyses; print, write and draw."""
    stiffness = solved(given, comm, "stiffness", keep_fields=True)
    onset = solved(
        given,
        comm,
        "envelope",
        interface=STRENGTHS,
        envelope={"plane": ["S11", "S22"], "directions": 12 if given.quick else 72},
    )
    fields = None if stiffness.fields is None else stiffness.fields.gathered()
    figures.finish(comm, write, given.out, stiffness, onset, fields)


def solved(
    given: argparse.Namespace, comm: Intracomm, analysis: str, keep_fields: bool = False, **sections: Any
) -> Result:
    """Run an analysis of the window, and return its result."""
    document = {
        "name": analysis,
        "cell": {
            "geometry": "table",
            "file": str(given.table.resolve()),
            "window": "cut",
            "mesh_size": 0.04 if given.quick else given.mesh_size,
            "order": 1 if given.quick else 2,
        },
        "material": MATERIAL,
        "analysis": {"type": analysis, "plane": "strain"},
        "output": figures.written(given) | {"stress_unit": "MPa", "length_unit": "um"},
        **sections,
    }
    return figures.computed(comm, Case.parse(document), given.out / analysis, keep_fields)


def local_fractions(result: Result) -> np.ndarray:
    """Return (N,) area of each fibre / area of its Voronoi cell."""
    cell, fibres = result.cell, result.fibres
    centres, radii = np.array([fibre.centre for fibre in fibres]), np.array([fibre.radius for fibre in fibres])
    return voronoi_cells(FibrePattern(cell.width, cell.height, centres, radii, periodic=True)).fractions


def largest_tractions(result: Result, fields: Any) -> np.ndarray:
    """Return (N,) largest normal traction of each fibre / S11, under a stress S11 alone."""
    strain = np.linalg.solve(result.effective_stiffness, [1.0, 0.0, 0.0])
    traction = sum(e * state.traction[:, 0] for e, state in zip(strain, fields.states, strict=True))
    largest = np.zeros(len(result.fibres))
    np.maximum.at(largest, fields.interface.fibre_number - 1, traction)
    return largest


def write(folder: Path, stiffness: Result, onset: Result, fields: Any) -> list[Path]:
    """Write micrograph.csv and micrograph.png."""
    from matplotlib.figure import Figure

    fractions, tractions = local_fractions(stiffness), largest_tractions(stiffness, fields)
    points = [point for point in onset.envelope or () if point.stress is not None]
    C11, C22, C33 = np.diag(stiffness.effective_stiffness)
    print(f"fibres {len(fractions)}, fraction {stiffness.cell.fibre_fraction:.4f}; C11, C22, C33: ", end="")
    print(f"{C11:.0f}, {C22:.0f}, {C33:.0f} MPa")
    print(f"onset under S11: {points[0].stress[0]:.2f} MPa, at fibre {points[0].fibre}")
    correlation = np.corrcoef(fractions, tractions)[0, 1]
    print(f"local fibre fractions {fractions.min():.2f} to {fractions.max():.2f}")
    print(f"largest tractions {tractions.min():.2f} to {tractions.max():.2f} S11, correlation {correlation:.2f}")
    first = sorted({point.fibre - 1 for point in points})
    figure = Figure(figsize=(13.6, 4.4), layout="constrained")
    micrograph, envelope, scatter = figure.subplots(1, 3)
    draw_fibres(micrograph, stiffness, tractions, first)
    stress = np.array([point.stress[:2] for point in points])
    envelope.plot(*stress[[*range(len(stress)), 0]].T, color=INK[0])
    envelope.set(xlabel="$\\Sigma_{11}$ (MPa)", ylabel="$\\Sigma_{22}$ (MPa)", aspect="equal")
    envelope.set_title("Onset of debonding", fontsize=11)
    scatter.scatter(fractions, tractions, s=12, color=INK[0], linewidth=0)
    scatter.scatter(fractions[first], tractions[first], s=22, color=INK[1], label="first to debond", linewidth=0)
    scatter.set(xlabel="local fibre fraction", ylabel=TRACTION)
    scatter.set_title(f"{len(fractions)} fibres, correlation {correlation:.2f}", fontsize=11)
    scatter.legend(frameon=False, fontsize=9)
    figure.savefig(folder / "micrograph.png")
    rows = [
        [k + 1, *fibre.centre, fibre.radius, fractions[k], tractions[k]] for k, fibre in enumerate(stiffness.fibres)
    ]
    head = ("fibre", "x", "y", "radius", "local fraction", "largest traction / S11")
    return [figures.tabulate(folder / "micrograph.csv", head, rows), folder / "micrograph.png"]


def draw_fibres(axes: Any, result: Result, tractions: np.ndarray, first: list[int]) -> None:
    """Draw the fibres coloured by their largest tractions, the first to break in the colour of their points."""
    from matplotlib.collections import EllipseCollection

    cell = result.cell
    steps = np.stack(np.meshgrid([-1, 0, 1], [-1, 0, 1]), axis=-1).reshape(-1, 2) * [cell.width, cell.height]
    centres = np.array([fibre.centre for fibre in result.fibres])
    for own, line, ink in ((slice(None), 0.3, "0.3"), (first, 1.6, INK[1])):
        diameters = np.tile([2 * fibre.radius for fibre in np.array(result.fibres, object)[own]], len(steps))
        discs = EllipseCollection(
            diameters,
            diameters,
            np.zeros(len(diameters)),
            units="xy",
            offsets=(steps[:, None] + centres[own]).reshape(-1, 2),
            offset_transform=axes.transData,
            array=np.tile(tractions[own], len(steps)),
            cmap="viridis",
            edgecolor=ink,
            linewidth=line,
        )
        discs.set_clim(tractions.min(), tractions.max())
        axes.add_collection(discs)
    axes.figure.colorbar(discs, ax=axes, label=TRACTION, shrink=0.85)
    (left, bottom), size = cell.origin, {"xlabel": "$x_1$ (um)", "ylabel": "$x_2$ (um)", "aspect": "equal"}
    axes.set(xlim=(left, left + cell.width), ylim=(bottom, bottom + cell.height), **size)
    axes.set_title("The window, made periodic", fontsize=11)


if __name__ == "__main__":
    options = figures.quick_parser(__doc__ or "", "micrograph", "a coarse mesh and few directions")
    options.add_argument("--table", type=Path, default=TABLE, help="table of fibres in a window")
    options.add_argument("--mesh-size", type=float, default=0.03, help="coarse element size / width of the window")
    sys.exit(launch(main, options))
