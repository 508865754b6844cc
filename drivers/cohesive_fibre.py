"""Debonding of one fibre by three laws of its interface: brittle, by released energy, and by a cohesive law.

    mpirun -n 2 .venv/bin/python drivers/cohesive_fibre.py --out results/cohesive_fibre

A square cell with one glass fibre of 7.5 um in epoxy, 40 %, plane strain, E11 alone.  The cohesive law is bilinear: 1e4
MPa/um, strengths of 60 and 84.85 MPa in opening and shear, toughnesses of 2 and 4 J/m2, so that the dissipated energy
does not depend on the path.  Brittle bonds have these strengths only.  Bonds that break by released energy need springs
as soft as 900 MPa/um for the same strengths and toughnesses.  Rows give the stress at the first event, the peak up to
twice the strain there, and the semi-angle of each debond at the end.  For the bilinear law strengths, toughnesses,
elements and teeth vary.  `--table` compares with an independent prototype.
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
RADIUS, FRACTION = 7.5, 0.4  # um
STIFFNESS = 1e4  # MPa/um
STRENGTH, TOUGHNESS = np.array([60.0, 60.0 * np.sqrt(2.0)]), np.array([2.0, 4.0])  # of opening and shear, MPa and J/m2
COARSE = 0.081  # of the width: 28 elements on the interface
UNIT = 0.0118  # strain
AT = (0.6, 0.8, 0.9, 1.0, 1.1, 1.25, 1.5, 2.0, 3.0)
# Straight triangles, dense algebra: by refinements and teeth, S11 of the first event and at AT.
PROTOTYPE = {
    (1, 8): (49.723, 27.27, 26.27, 26.56, 26.68, 26.72, 27.87, 29.94, 35.66, 49.97),
    (1, 32): (44.416, 24.42, 23.93, 24.20, 24.56, 25.11, 26.31, 29.00, 35.11, 49.57),
    (2, 8): (49.539, 25.69, 25.18, 25.89, 25.99, 26.23, 27.22, 29.57, 35.29, 49.51),
    (2, 16): (45.948, 24.42, 24.18, 24.44, 24.87, 25.36, 26.47, 28.98, 34.97, 49.33),
    (2, 32): (44.251, 24.07, 23.76, 23.99, 24.43, 25.12, 26.22, 28.81, 34.86, 49.25),
}
TITLES = {"strength": "brittle, by strength", "released": "by released energy", "bilinear": "bilinear"}
COLUMNS = ("law", "strength", "toughness", "element um", "teeth", "onset S11", "peak S11", "debonding angle",
           *(f"S11 at {x:g}" for x in AT))  # fmt: skip


class Interface(NamedTuple):
    """A law with multiples of the strengths and toughnesses above, on a mesh, in teeth."""

    law: str
    refine: int
    teeth: int
    strength: float = 1.0
    toughness: float = 1.0

    def section(self) -> dict[str, Any]:
        """Return [interface]."""
        strength, toughness = self.strength * STRENGTH, self.toughness * TOUGHNESS
        strengths = {"normal_strength": strength[0], "tangential_strength": strength[1]}
        if self.law == "strength":
            return strengths
        if self.law == "released":
            soft = strength**2 / 2 / toughness
            springs = {"normal_stiffness": soft[0], "tangential_stiffness": soft[1]}
            # Twice the toughness in shear.
            energy = {"toughness": toughness[0], "mode_sensitivity": 0.5}
            return springs | {"criterion": "energy", "growth": "released"} | energy
        toughnesses = {"normal_toughness": toughness[0], "tangential_toughness": toughness[1]}
        springs = {"normal_stiffness": STIFFNESS, "tangential_stiffness": STIFFNESS}
        return {"law": "bilinear", "teeth": self.teeth} | springs | strengths | toughnesses

    @property
    def label(self) -> str:
        """The name of the result folder."""
        numbers = f"{self.law}_{self.refine}_{self.teeth}"
        return numbers + f"_{self.strength:g}_{self.toughness:g}".replace("_1_1", "")


def main(given: argparse.Namespace, comm: Intracomm) -> None:
    """Follow the paths of all interfaces; print, write and draw."""
    if given.quick:
        given.refine, given.teeth = 0, 2
    own = Interface("bilinear", given.refine, given.teeth)
    asked = [own._replace(law=law) for law in TITLES]
    asked += [own._replace(toughness=2.0), own._replace(teeth=2 * own.teeth)]
    if not given.quick:
        asked += [own._replace(strength=0.75), own._replace(strength=1.5), own._replace(toughness=0.5)]
        asked += [own._replace(teeth=4 * own.teeth), own._replace(refine=own.refine + 1)]
    if given.table:
        rows = list(PROTOTYPE)[: 1 if given.quick else None]
        asked += [own._replace(refine=refine, teeth=teeth) for refine, teeth in rows]
    found = {interface: solved(given, comm, interface) for interface in dict.fromkeys(asked)}
    figures.finish(comm, write, given.out, found, own)


def solved(given: argparse.Namespace, comm: Intracomm, interface: Interface) -> Result:
    """Return the path of one interface."""
    document = {
        "name": interface.label,
        "cell": {
            "geometry": "square",
            "fibre_radius": RADIUS,
            "fibre_fraction": FRACTION,
            "mesh_size": COARSE,
            "refine": interface.refine,
        },
        "material": MATERIAL,
        "analysis": {"type": "path", "plane": "strain"},
        "interface": interface.section(),
        "path": {"strain": [AT[-1] * UNIT, 0.0, 0.0]},
        "output": figures.written(given) | {"stress_unit": "MPa", "length_unit": "um"},
    }
    return figures.computed(comm, Case.parse(document), given.out / interface.label)


def numbers(result: Result) -> list[float]:
    """Return the stress at the first event, the peak, the semi-angle of each debond and the stresses at AT."""
    first, last = (result.path or ())[0], (result.path or ())[-1]
    rising = result.rising_strain()
    strain, stress = rising["E11"], rising["S11"]
    peak = stress[strain <= 2 * first.strain[0]].max()
    # Two debonds, each symmetric about its pole.
    angle = 90.0 * (1.0 - last.bonded / (last.bonded + last.open + last.closed))
    # What is left where the stress falls at constant strain.
    before = [min(np.flatnonzero(strain <= x * UNIT)[-1], len(strain) - 2) for x in AT]
    at = [np.interp(x * UNIT, strain[k : k + 2], stress[k : k + 2]) for x, k in zip(AT, before, strict=True)]
    return [first.stress[0], peak, angle, *at]


def element(result: Result) -> float:
    """Return the length of the elements on the interface, um."""
    first = (result.path or ())[0]
    return 2 * np.pi * RADIUS / (first.bonded + first.open + first.closed)


def write(folder: Path, found: dict[Interface, Result], own: Interface) -> list[Path]:
    """Write cohesive_fibre.csv and cohesive_fibre.png."""
    header = "law       strength  toughness  element um  teeth  onset MPa   peak   angle"
    print(header + "".join(f"{x:>8g}" for x in AT))
    rows = []
    for interface, result in found.items():
        law, _, teeth, strength, toughness = interface
        onset, peak, angle, *at = numbers(result)
        print(
            f"{law:<10}{strength:>8g}{toughness:>11g}{element(result):>12.3f}{teeth if law == 'bilinear' else '-':>7}"
            f"{onset:>11.3f}{peak:>7.2f}{angle:>8.1f}" + "".join(f"{x:>8.2f}" for x in at)
        )
        if law == "bilinear" and strength == toughness == 1.0 and (interface.refine, teeth) in PROTOTYPE:
            off = 100 * (np.array([onset, *at]) / PROTOTYPE[interface.refine, teeth] - 1.0)
            deviation = "".join(f"{x:>7.2f}%" for x in off[1:])
            print(f"{'  from the prototype':<48}{off[0]:>10.2f}%{'':<15}{deviation}")
        rows.append([law, strength, toughness, element(result), teeth, onset, peak, angle, *at])
    draw(folder / "cohesive_fibre.png", curves(found, own))
    return [figures.tabulate(folder / "cohesive_fibre.csv", COLUMNS, rows), folder / "cohesive_fibre.png"]


def curves(found: dict[Interface, Result], own: Interface) -> dict[str, dict[str, Result]]:
    """Return the results of each panel by their labels."""
    bilinear = {interface: result for interface, result in found.items() if interface.law == "bilinear"}
    here = {i: result for i, result in bilinear.items() if i[1:3] == own[1:3]}
    same = {i: result for i, result in bilinear.items() if i[3:] == own[3:]}
    return {
        "three laws": {title: found[own._replace(law=law)] for law, title in TITLES.items()},
        "bilinear, of other strengths N and toughnesses G": {
            f"{i.strength:g} N, {i.toughness:g} G": result for i, result in here.items()
        },
        "bilinear, on other elements, in other teeth": {
            f"{element(result):.2f} um, {i.teeth} teeth": result for i, result in same.items()
        },
    }


def draw(path: Path, panels: dict[str, dict[str, Result]]) -> None:
    """Draw the stress over a rising strain."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12.0, 4.2), layout="constrained")
    for axes, (title, results) in zip(figure.subplots(1, 3, sharex=True, sharey=True), panels.items(), strict=True):
        for k, (label, result) in enumerate(results.items()):
            rising, style = result.rising_strain(), ("-", "--", ":")[k // len(INK) % 3]
            ink = INK[k % len(INK)]
            axes.plot(100 * rising["E11"], rising["S11"], style, color=ink, linewidth=1.1, label=label)
        axes.set_title(title, fontsize=10)
        axes.set(xlabel="$E_{11}$ (%)", ylabel="$\\Sigma_{11}$ (MPa)")
        axes.label_outer()
        axes.grid(color="0.92", linewidth=0.6)
        axes.legend(frameon=False, fontsize=8)
    axes.set_ylim(bottom=0.0)  # of all: the axes share it, and a limit ends its growth with further curves
    figure.suptitle("One glass fibre that debonds from epoxy", fontsize=11)
    figure.savefig(path)


if __name__ == "__main__":
    options = figures.quick_parser(__doc__ or "", "cohesive_fibre", "fewer interfaces, longer elements")
    options.add_argument("--refine", type=int, default=0, help="times that elements of 1.68 um are halved")
    options.add_argument("--teeth", type=int, default=8, help="of the bilinear law")
    options.add_argument("--table", action="store_true", help="also the table of the prototype, in minutes")
    sys.exit(launch(main, options))
