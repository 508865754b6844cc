"""Compare published ply constants and energy release rates, and measured plies, with computed values.

    mpirun -n 2 .venv/bin/python drivers/published.py --out results/published

Constants in GPa: boron/aluminium of a square arrangement by the finite elements of Sun and Vaidya (Compos. Sci.
Technol. 56, 1996, 171) and by multipole series.  Energy release rates by finite elements (Di Stasio,
thinPlyMechanics): one debonded fibre in a large matrix, G / G0, and a square arrangement of 60 %, whose fibres are
debonded towards each other, side by side, G in J/m2.

Measured: four plies of the World-Wide Failure Exercise (WWFE; Soden, Hinton, Kaddour, Compos. Sci. Technol. 58, 1998,
1011) beside hexagonal arrangements of their fibres and matrices; GPa, 1/K.
"""

import argparse
import sys
from pathlib import Path
from typing import Any, NamedTuple

import figures
import numpy as np
from figures import INK
from mpi4py.MPI import Intracomm

from feti_homog import Case, launch


class Row(NamedTuple):
    """A quantity of a source: published and computed number."""

    source: str
    quantity: str
    published: float
    own: float


class Ply(NamedTuple):
    """Phases, arrangement and published constants of a ply."""

    fibre: dict[str, float]
    matrix: dict[str, float]
    fraction: float
    geometry: str
    constants: dict[str, float]


def isotropic(young: float, poisson: float, expansion: float | None = None) -> dict[str, float]:
    """Return a phase of the case file."""
    return {"young": young, "poisson": poisson} | ({} if expansion is None else {"expansion": expansion})


def measured(fibre: dict[str, float], matrix: dict[str, float], fraction: float, *values: float) -> Ply:
    """Return a ply of the WWFE and its values, in the order of OF_PLY."""
    return Ply(fibre, matrix, fraction, "hexagonal", dict(zip(OF_PLY, values, strict=False)))


BORON, ALUMINIUM = isotropic(379.3, 0.1), isotropic(68.3, 0.3)
# Those of the cell have x3 along the fibres: its E1 is E2 of the ply, its G12 and nu12 are G23 and nu23.
OF_CELL = ("E3", "E1", "G13", "G12", "nu12")
SUN_VAIDYA = (215.0, 144.0, 57.2, 45.9, 0.29)
SERIES = (215.334687, 143.955632, 54.3778718, 45.8243281, 0.255133319)
PLIES = {
    "B/Al, Sun and Vaidya": Ply(BORON, ALUMINIUM, 0.47, "square", dict(zip(OF_CELL, SUN_VAIDYA, strict=True))),
    "B/Al, multipole series": Ply(BORON, ALUMINIUM, 0.47, "square", dict(zip(OF_CELL, SERIES, strict=True))),
}
OF_PLIES = dict(zip(OF_CELL, ("E1", "E2", "G12", "G23", "nu23"), strict=True))
# Constants of the nearest transversely isotropic material.
OF_PLY = ("E_axial", "E_transverse", "G_axial", "nu_axial", "expansion_axial", "expansion_transverse")
OF_PLIES |= dict(zip(OF_PLY, ("E1", "E2", "G12", "nu12", "alpha1", "alpha2"), strict=True))
CARBON = {"E_axial": 225.0, "E_transverse": 15.0, "G_axial": 15.0, "nu_axial": 0.2, "G_transverse": 7.0}
AS4 = CARBON | {"expansion_axial": -0.5e-6, "expansion_transverse": 15e-6}
T300 = CARBON | {"E_axial": 230.0, "expansion_axial": -0.7e-6, "expansion_transverse": 12e-6}
GEVETEX, SILENKA = isotropic(80.0, 0.2, 4.9e-6), isotropic(74.0, 0.2, 4.9e-6)
EPOXY = isotropic(3.35, 0.35, 58e-6)  # LY556/HT907/DY063, and MY750/HY917/DY063
MEASURED = {
    "WWFE, AS4/3501-6": measured(AS4, isotropic(4.2, 0.34, 45e-6), 0.6, 126.0, 11.0, 6.6, 0.28, -1e-6, 26e-6),
    "WWFE, T300/BSL914C": measured(T300, isotropic(4.0, 0.35, 55e-6), 0.6, 138.0, 11.0, 5.5, 0.28, -1e-6, 26e-6),
    "WWFE, E-glass/LY556": measured(GEVETEX, EPOXY, 0.62, 53.48, 17.7, 5.83, 0.278, 8.6e-6, 26.4e-6),
    "WWFE, E-glass/MY750": measured(SILENKA, EPOXY, 0.6, 45.6, 16.2, 5.83, 0.278),
}
GLASS_EPOXY = {"fibre": isotropic(70.0, 0.2), "matrix": isotropic(3.5, 0.4)}
ONE_FIBRE = {20: 0.3485, 40: 0.5963, 60: 0.6859, 80: 0.6085, 100: 0.3563}  # G / G0 by half the opening in degrees
TWO_FIBRES = {10: 2.1239, 60: 0.9416, 90: 0.2767, 120: 0.0327}  # J/m2, the same
WIDTHS = 40  # of the cell in radii, around one fibre
COLUMNS = ("source", "quantity", "published", "computed", "difference %")


def main(given: argparse.Namespace, comm: Intracomm) -> None:
    """Compute all; print, write and draw the differences."""
    rows = [row for name, own in PLIES.items() for row in of_ply(given, comm, name, own)]
    rows += one_fibre(given, comm) + two_fibres(given, comm)
    rows += [row for name, own in MEASURED.items() for row in of_ply(given, comm, name, own)]
    figures.finish(comm, write, given.out, rows)


def solved(given: argparse.Namespace, comm: Intracomm, name: str, **sections: Any) -> Any:
    """Return the result of a case."""
    folder = given.out / name.replace(" ", "_").replace("/", "-").replace(",", "")
    return figures.computed(comm, Case.parse({"name": name, "output": figures.written(given), **sections}), folder)


def of_ply(given: argparse.Namespace, comm: Intracomm, name: str, own: Ply) -> list[Row]:
    """Return the constants of a ply."""
    mesh_size = 0.2 if given.quick else 0.1
    cell = {"geometry": own.geometry, "fibre_fraction": own.fraction, "mesh_size": mesh_size, "refine": 1, "order": 2}
    material, analysis = {"fibre": own.fibre, "matrix": own.matrix}, {"type": "stiffness", "plane": "generalized"}
    document = solved(given, comm, name, cell=cell, material=material, analysis=analysis).document
    found = document["constants"] | document["transversely_isotropic"]
    return [Row(name, OF_PLIES[key], value, float(found[key])) for key, value in own.constants.items()]


def one_fibre(given: argparse.Namespace, comm: Intracomm) -> list[Row]:
    """Compute G / G0 of one debonded fibre in a wide cell.

    The macroscopic strain is the strain of the pure matrix under uniaxial stress.
    """
    young, poisson = (GLASS_EPOXY["matrix"][name] for name in ("young", "poisson"))
    strain = [(1 - poisson**2) / young, -poisson * (1 + poisson) / young, 0.0]
    cell = {"geometry": "square", "fibre_fraction": np.pi / WIDTHS**2, "fibre_radius": 1.0, "mesh_size": 0.05}
    finer = {"interface_size": 0.06 / WIDTHS, "tip_size": 6e-4 / WIDTHS, "order": 2}
    angles = list(ONE_FIBRE)[1:4:2] if given.quick else list(ONE_FIBRE)
    result = solved(
        given, comm, "one fibre", cell=cell | finer, material=GLASS_EPOXY,
        analysis={"type": "angle", "plane": "strain"}, interface={"contact": True, "debonded": [{"fibre": 1}]},
        angle={"values": [2.0 * t for t in angles], "strain": strain},
    )  # fmt: skip
    scale = (1 + 3 - 4 * poisson) / (8 * young / (2 * (1 + poisson))) * np.pi
    released = [float(point.tips.G.mean() / point.stress[0] ** 2 / scale) for point in result.angle]
    return [
        Row("one debonded fibre", f"G / G0, {t} deg", ONE_FIBRE[t], G) for t, G in zip(angles, released, strict=True)
    ]


def two_fibres(given: argparse.Namespace, comm: Intracomm) -> list[Row]:
    """Return G of a fibre and its mirror image, debonded towards each other, under E11 = 0.01 alone."""
    side = float(np.sqrt(np.pi / 0.6))
    places = [{"x": (k + 0.5) * side, "y": side / 2, "radius": 1.0} for k in range(2)]
    cell = {"geometry": "table", "width": 2 * side, "height": side, "fibre_list": places, "order": 2, "mesh_size": 0.05}
    rows = []
    for t in list(TWO_FIBRES)[1:3] if given.quick else TWO_FIBRES:
        arcs = [{"fibre": k + 1, "centre": 180.0 * k, "angle": 2.0 * t} for k in range(2)]
        result = solved(
            given, comm, f"two fibres {t}", cell=cell, material=GLASS_EPOXY,
            analysis={"type": "load", "plane": "strain"}, interface={"contact": True, "debonded": arcs},
            load={"to": {"E11": 0.01}},
        )  # fmt: skip
        rows.append(Row("debonds side by side", f"G, {t} deg", TWO_FIBRES[t], 1e3 * float(result.load.tips.G.mean())))
    return rows


def write(folder: Path, rows: list[Row]) -> list[Path]:
    """published.csv and published.png."""
    from matplotlib.figure import Figure

    print(f"{'source':<24}{'quantity':<18}{'published':>11}{'computed':>11}{'difference':>12}")
    off = [100 * (row.own / row.published - 1) for row in rows]
    for row, percent in zip(rows, off, strict=True):
        print(f"{row.source:<24}{row.quantity:<18}{row.published:>11.5g}{row.own:>11.5g}{percent:>10.2f} %")
    figure = Figure(figsize=(8.4, 0.22 * len(rows) + 1.8), layout="constrained")
    parts = [[k for k, row in enumerate(rows) if (row.source in MEASURED) == chosen] for chosen in (False, True)]
    ratios = {"height_ratios": [len(part) for part in parts]}
    for part, axes, kind in zip(parts, figure.subplots(2, gridspec_kw=ratios), ("published", "measured"), strict=True):
        sources = list(dict.fromkeys(rows[k].source for k in part))
        for place, k in enumerate(part):
            ink = INK[sources.index(rows[k].source) % len(INK)]
            axes.plot([0.0, off[k]], [place, place], "-o", markevery=[1], color=ink)
        axes.set_yticks(range(len(part)), [f"{rows[k].source}: {rows[k].quantity}" for k in part], fontsize=8)
        axes.axvline(0.0, color="0.5", linewidth=0.8)
        axes.set(xlabel=f"computed beside {kind} (%)", ylim=(len(part) - 0.5, -0.5))
        axes.grid(color="0.92", linewidth=0.6, axis="x")
    figure.savefig(folder / "published.png")
    table = [[*row, percent] for row, percent in zip(rows, off, strict=True)]
    return [figures.tabulate(folder / "published.csv", COLUMNS, table), folder / "published.png"]


if __name__ == "__main__":
    options = figures.quick_parser(__doc__ or "", "published", "coarse meshes, few angles")
    sys.exit(launch(main, options))
