"""Debonding by energy of a single fibre, whose onset stress depends on its radius.

    mpirun -n 2 .venv/bin/python drivers/energy_debonding.py --out results/energy_debonding

One glass fibre in much epoxy, plane strain, under remote uniaxial tension s11: a square cell of 60 radii, strained by
its own compliance.  The interface has springs of 2025 and 506.25 MPa/um and a toughness of 2 J/m2, which is a strength
of 90 MPa in pure opening.  For each radius the driver compares the remote stress at the first break with the exact
stress for an infinite matrix (Tavara, Mantic, Graciani, Paris 2011).  The semi-angle tells how far the debonds at both
poles then run at once, before the stress must rise again.
"""

import argparse
import sys
from pathlib import Path
from typing import Any, NamedTuple

import figures
import numpy as np
from figures import INK
from mpi4py.MPI import Intracomm

from feti_homog import Case, Result, launch

MATERIAL = {"matrix": {"young": 2790.0, "poisson": 0.33}, "fibre": {"young": 70800.0, "poisson": 0.22}}  # MPa
NORMAL, TANGENTIAL, TOUGHNESS, SENSITIVITY = 2025.0, 506.25, 2.0, 0.25  # MPa/um, MPa/um, J/m2, 1
RADII = [1.5, 3.0, 7.5, 15.0, 30.0, 75.0]  # um
CELL_PER_RADIUS = 60.0
LENGTH = 0.77  # um, E' G / sigma_c^2, along which bonds break
COLUMNS = ("radius", "onset", "exact onset", "debonding angle", "elements")


class Onset(NamedTuple):
    """Remote stress and exact stress (MPa), semi-angle to which each debond runs (degrees), and elements."""

    stress: float
    exact: float
    angle: float
    elements: int


def main(given: argparse.Namespace, comm: Intracomm) -> None:
    """Follow the path of each radius; print, write and draw."""
    radii = RADII[1:4:2] if given.quick else RADII
    found = {radius: onset(given, comm, radius) for radius in radii}
    figures.finish(comm, write, given.out, found)


def onset(given: argparse.Namespace, comm: Intracomm, radius: float) -> Onset:
    """Compute the first break at a fibre of this radius, and the debond that follows at once."""
    exact = exact_onset(radius)
    stiffness = solved(given, comm, radius, analysis={"type": "stiffness", "plane": "strain"}).effective_stiffness
    strain = np.linalg.solve(np.array(stiffness), [1.5 * exact, 0.0, 0.0])
    energy = {"criterion": "energy", "toughness": TOUGHNESS, "mode_sensitivity": SENSITIVITY}
    result = solved(
        given,
        comm,
        radius,
        analysis={"type": "path", "plane": "strain"},
        interface=energy,
        path={"strain": strain.tolist()},
    )
    points = result.path or ()
    first = points[0]
    stable = next((p for p in points[1:] if p.load_factor > first.load_factor), points[-1])
    total = first.bonded + first.open + first.closed
    # Two debonds, each symmetric about its pole.
    return Onset(first.stress[0], exact, 90.0 * (1.0 - stable.bonded / total), result.cell.elements)


def solved(given: argparse.Namespace, comm: Intracomm, radius: float, **sections: dict[str, Any]) -> Result:
    """Return the result of a cell with this fibre and sections, plane strain."""
    width = CELL_PER_RADIUS * radius
    node_distance = min(LENGTH / 2, 2 * np.pi * radius / 96) * (4 if given.quick else 1)
    springs = {"normal_stiffness": NORMAL, "tangential_stiffness": TANGENTIAL}
    document = {
        "name": f"fibre of {radius:g} um",
        "cell": {
            "geometry": "square",
            "fibre_radius": radius,
            "fibre_fraction": np.pi / CELL_PER_RADIUS**2,
            "order": 2,
            "mesh_size": 0.1,
            "interface_size": 2 * node_distance / width,
        },
        "material": MATERIAL,
        "output": figures.written(given) | {"stress_unit": "MPa", "length_unit": "um"},
        **sections,
        "interface": springs | sections.get("interface", {}),
    }
    kind = sections["analysis"]["type"]
    return figures.computed(comm, Case.parse(document), given.out / f"{kind}_{radius:g}_um")


def exact_onset(radius: float) -> float:
    """Return the remote uniaxial stress (MPa) at which the first bond of a fibre in an infinite matrix breaks.

    Tractions t_n = p0 + N cos 2t, t_t = T sin 2t from the plane problem of a circular inclusion on springs, per unit
    remote stress; the bond with the largest sqrt(G / G_c) breaks first.
    """
    (mu_m, kappa_m), (mu_f, kappa_f) = (
        (p["young"] / 2 / (1 + p["poisson"]), 3 - 4 * p["poisson"]) for p in (MATERIAL["matrix"], MATERIAL["fibre"])
    )
    s = d = 0.5
    kn, kt = NORMAL * radius, TANGENTIAL * radius
    p0 = s * (kappa_m + 1) / (2 + (kappa_f - 1) * mu_m / mu_f + 4 * mu_m / kn)
    # Unknowns b, B of the fibre and C, D of the matrix: N, T on both sides, opening and slip.
    matrix = [
        [-2, 0, 6, 4],
        [2, 6, 6, 2],
        [1 / mu_f + 2 / kn, -(kappa_f - 3) / 2 / mu_f, 1 / mu_m, (kappa_m + 1) / 2 / mu_m],
        [-1 / mu_f - 2 / kt, -(kappa_f + 3) / 2 / mu_f - 6 / kt, 1 / mu_m, -(kappa_m - 1) / 2 / mu_m],
    ]
    b, B, _, _ = np.linalg.solve(matrix, [d, -d, -d / 2 / mu_m, d / 2 / mu_m])
    t = np.linspace(0.0, np.pi / 2, 100_001)
    normal, shear = p0 - 2 * b * np.cos(2 * t), (2 * b + 6 * B) * np.sin(2 * t)
    roots = np.maximum(normal, 0.0) / np.sqrt(2 * NORMAL), np.abs(shear) / np.sqrt(2 * TANGENTIAL)
    used = np.hypot(*roots) * np.cos((1 - SENSITIVITY) * np.arctan2(roots[1], roots[0]))
    return float(np.sqrt(TOUGHNESS) / used.max())


def write(folder: Path, found: dict[float, Onset]) -> list[Path]:
    """Write energy_debonding.csv and energy_debonding.png."""
    from matplotlib.figure import Figure

    print("radius um  onset MPa   exact   error   debonding angle  elements")
    for radius, o in found.items():
        error = 100 * (o.stress / o.exact - 1)
        print(f"{radius:>9g}{o.stress:>11.3f}{o.exact:>8.3f}{error:>7.2f}%{o.angle:>15.1f} deg{o.elements:>10}")
    figure = Figure(figsize=(9.6, 4.2), layout="constrained")
    left, right = figure.subplots(1, 2)
    radii, onsets = np.array(list(found)), list(found.values())
    fine = np.geomspace(1.0, 100.0, 60)
    left.plot(fine, [exact_onset(a) for a in fine], color=INK[0], label="exact, infinite matrix")
    left.plot(radii, [o.stress for o in onsets], "o", color=INK[1], label="computed")
    stiff = exact_onset(1e9)
    left.axhline(stiff, color="0.5", linewidth=0.8, linestyle="--", label="a fibre of any size, by strength")
    left.set(xscale="log", xlabel="radius of the fibre (um)", ylabel="remote stress at onset (MPa)")
    left.legend(frameon=False, fontsize=9)
    right.plot(radii, [o.angle for o in onsets], "o-", color=INK[1])
    right.set(xscale="log", xlabel="radius of the fibre (um)", ylabel="semi-angle of each debond after onset (deg)")
    right.set_ylim(0.0, 90.0)
    for axes in (left, right):
        axes.set_xticks([1, 3, 10, 30, 100], ["1", "3", "10", "30", "100"])
        axes.set_xlim(1.0, 100.0)
        axes.grid(color="0.92", linewidth=0.6)
    figure.suptitle("One glass fibre in epoxy, interface that breaks by energy", fontsize=11)
    figure.savefig(folder / "energy_debonding.png")
    rows = [[radius, o.stress, o.exact, o.angle, o.elements] for radius, o in found.items()]
    return [figures.tabulate(folder / "energy_debonding.csv", COLUMNS, rows), folder / "energy_debonding.png"]


if __name__ == "__main__":
    options = figures.quick_parser(__doc__ or "", "energy_debonding", "two radii, longer elements")
    sys.exit(launch(main, options))
