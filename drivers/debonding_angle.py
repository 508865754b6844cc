"""Fig. 3 of the paper: response of the hexagonal cell (38) with 40 % of fibres against the debonding angle.

    mpirun -n 2 .venv/bin/python drivers/debonding_angle.py --out results/debonding_angle

a: L^ef in plane strain, in plane stress, and for long fibres that are free along x3, mean S33 = 0 (the paper uses a
three-dimensional cell); debonded faces overlap freely.
b: Sigma in plane strain under E = [0, 0, 0.2] (40), with and without contact.

The paper prints curves, no numbers.  At both ends of the curves multipole series give exact values: of the bonded cell,
and without contact of a cell with holes.

Convention: every fibre has one debonded arc, centred on the positive x1 axis through its own centre; the angle is the
arc's whole opening in degrees, measured at that centre.  0 is perfect bonding, 360 a loose fibre.
"""

import argparse
import sys
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import figures
import numpy as np
from effective_stiffness import REFERENCE
from figures import ENTRY_INK
from mpi4py.MPI import Intracomm
from numpy.typing import NDArray

from feti_homog import launch

SHEAR = [0.0, 0.0, 0.2]
STIFFNESSES = {"11": (0, 0), "22": (1, 1), "12": (0, 1), "33": (2, 2)}
STRESSES = ("11", "22", "12")
PLANES = {"strain": "--", "stress": "-."}
CURVES = {"plane strain": "--", "long fibres": "-", "plane stress": "-."}
# Exact C11, C12, C33 in plane strain at the angle 360, of a cell with holes.
HOLES = (36.123857, 14.523762, 10.800047)
CONTACT = {"with contact": "-", "without contact": "--"}


def main(given: argparse.Namespace, comm: Intracomm) -> None:
    """Run the cases of both figures, write a table and draw it."""
    angles = [*np.arange(0.0, 360.0, 90.0 if given.quick else given.step).tolist(), 360.0]

    def points(name: str, plane: str, contact: bool, **load: Any) -> dict[str, Any]:
        return figures.solved(
            given, comm, name, "hexagonal", figures.EQUATION_38,
            analysis={"type": "angle", "plane": plane},
            interface={"contact": contact, "debonded": [{"fibre": "all", "centre": 0.0}]},
            angle={"values": angles, **load},
        ).points  # fmt: skip

    i, j = np.array(list(STIFFNESSES.values())).T
    free = {f"plane {plane}": points(f"plane {plane}", plane, False)["stiffness"] for plane in PLANES}
    free["long fibres"] = without_S33(points("long fibres", "generalized", False)["stiffness"])
    assert_between(free["plane stress"], free["long fibres"], free["plane strain"])
    entries = {name: free[name][:, i, j] for name in CURVES}
    shear = {
        word: points(f"shear {word}", "strain", word == "with contact", strain=SHEAR)["stress"] for word in CONTACT
    }
    figures.finish(comm, write, given.out, angles, entries, shear)


def without_S33(stiffness: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return (n, 3, 3) C_ij - C_i3 C_3j / C_33 on [11, 22, 12] of stiffnesses (n, 6, 6), without mean S33."""
    condensed = stiffness - stiffness[:, :, 2:3] * stiffness[:, 2:3, :] / stiffness[:, 2:3, 2:3]
    return np.asarray(condensed[np.ix_(range(len(stiffness)), [0, 1, 5], [0, 1, 5])])


def assert_between(*stiffnesses: NDArray[np.float64]) -> None:
    """Assert that no stiffness (n, 3, 3) exceeds the next: differences have no negative eigenvalues beyond rounding."""
    for lower, upper in pairwise(stiffnesses):
        least = np.linalg.eigvalsh(upper - lower)[:, 0] / np.abs(upper).max(axis=(1, 2))
        if least.min() < -1e-7:
            raise AssertionError(f"the order of the stiffnesses does not hold: {least.min():.1e}")


def write(folder: Path, angles: list[float], free: dict[str, Any], shear: dict[str, Any]) -> list[Path]:
    """Write debonding_angle.csv and debonding_angle.png."""
    from matplotlib.figure import Figure

    _print_ends(free, shear)
    header = ["angle", *(f"C{e} {name}" for name in free for e in STIFFNESSES)]
    header += [f"S{e} {word}" for word in shear for e in STRESSES]
    rows = np.column_stack([angles, *free.values(), *shear.values()]).tolist()
    figure = Figure(figsize=(9.6, 4.2), layout="constrained")
    left, right = figure.subplots(1, 2)
    _curves(left, angles, free, CURVES, "C", list(STIFFNESSES))
    left.set(title="a. effective stiffness, no contact", ylabel="effective stiffness (GPa)", ylim=(0, None))
    _curves(right, angles, shear, CONTACT, r"\Sigma", STRESSES)
    right.set(title=r"b. $E = [0, 0, 0.2]$, plane strain", ylabel="macroscopic stress (GPa)")
    figure.savefig(folder / "debonding_angle.png")
    return [figures.tabulate(folder / "debonding_angle.csv", header, rows), folder / "debonding_angle.png"]


def _print_ends(free: dict[str, Any], shear: dict[str, Any]) -> None:
    """Print both ends of the curves beside exact values."""
    print(f"{'curve':<26}{'angle':>6}{'exact':>12}{'computed':>12}{'difference':>12}")
    bonded = {plane: REFERENCE["hexagonal", plane] for plane in PLANES}
    rows = [(f"plane {plane}", 0, bonded[plane]) for plane in PLANES] + [("plane strain", 360, HOLES)]
    names = list(STIFFNESSES)
    lines = [
        (f"C{name} {curve}", angle, exact, free[curve][-1 if angle else 0, names.index(name)])
        for curve, angle, values in rows
        for name, exact in zip(("11", "12", "33"), values, strict=True)
    ]
    lines += [(f"S12 {name}", 0, SHEAR[2] * bonded["strain"][2], shear[name][0, 2]) for name in CONTACT]
    lines.append(("S12 without contact", 360, SHEAR[2] * HOLES[2], shear["without contact"][-1, 2]))
    for curve, angle, exact, own in lines:
        print(f"{curve:<26}{angle:>6}{exact:>12.5f}{own:>12.5f}{own / exact - 1:>12.1e}")


def _curves(
    axes: Any, angles: list[float], values: dict[str, Any], styles: dict[str, str], letter: str,
    entries: Sequence[str],
) -> None:  # fmt: skip
    """Draw a colour per entry and a line style per case."""
    inks = [ENTRY_INK["33" if letter != "C" and entry == "12" else entry] for entry in entries]
    for entry, ink in zip(entries, inks, strict=True):
        axes.plot([], [], color=ink, label=f"${letter}_{{{entry}}}$")
    for name, style in styles.items():
        for column, ink in zip(values[name].T, inks, strict=True):
            axes.plot(angles, column, style, color=ink, linewidth=1.6)
        axes.plot([], [], style, color="0.3", label=name)
    axes.set(xlabel="debonding angle (degrees)", xlim=(0, 360), xticks=range(0, 361, 60))
    axes.grid(color="0.92", linewidth=0.6)
    axes.legend(frameon=False, fontsize=9)


def parser() -> argparse.ArgumentParser:
    options = figures.parser(__doc__ or "", "debonding_angle", mesh_size=0.06, refine=0, order=2)
    options.add_argument("--step", type=float, default=15.0, help="of the angle, in degrees")
    return options


if __name__ == "__main__":
    sys.exit(launch(main, parser()))
